// Samples of a part of the cloud, sorted into cells: how far the nearest neighbours of each are on average.
#pragma once
#include <cstdint>
#include <vector>

namespace lamina::clean {

/// Positions in fixed-point steps; parallel arrays.
struct Positions {
  std::vector<std::int32_t> x, y, z;
  [[nodiscard]] std::size_t size() const { return x.size(); }
};

/// Neighbours are looked for as far as so many cells; farther ones count as if they were there.
inline constexpr int kFarthestCells = 6;

/// For each of the first `wanted` positions the mean distance (steps) to its `neighbours` nearest among all the others,
/// distances beyond kFarthestCells cells counting as that. Depends on the set of positions alone. `cell` >= 1024.
std::vector<float> mean_distances(const Positions& positions, std::size_t wanted, std::uint32_t neighbours,
                                  std::int32_t cell);

/// The least cell, half octaves from 1024 on, that holds `wanted` of the positions on average, empty ones not counted.
std::int32_t counting_cell(const Positions& positions, double wanted);

}  // namespace lamina::clean
