// Statistical outliers: samples whose nearest neighbours are much farther away than is usual in the cloud (Rusu et al.
// 2008, "Towards 3D point cloud based object maps for household environments").
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/run.h"
#include "store/slab_store.h"

namespace lamina {

/// Positions in fixed-point steps; parallel arrays.
struct Positions {
  std::vector<std::int32_t> x, y, z;
  [[nodiscard]] std::size_t size() const { return x.size(); }
};

/// Neighbours are looked for as far as so many cells, a dozen spacings; farther ones count as if they were there.
inline constexpr int kFarthestCells = 6;

/// For each of the first `wanted` positions the mean distance (steps) to its `neighbours` nearest among all the others,
/// distances beyond kFarthestCells cells counting as that. Depends on the set of positions alone. `cell` >= 1024.
std::vector<float> mean_distances(const Positions& positions, std::size_t wanted, std::uint32_t neighbours,
                                  std::int32_t cell);

/// The least cell, half octaves from 1024 on, that holds `wanted` of the positions on average, empty ones not counted.
std::int32_t counting_cell(const Positions& positions, double wanted);

/// Which samples of each bucket stay.
using KeepMasks = std::vector<std::vector<bool>>;

/// Why samples of each bucket do not stay: the number of a reason, 0 where they do. A bucket that loses none may have
/// no list.
using Reasons = std::vector<std::vector<std::uint8_t>>;
enum Reason : std::uint8_t {
  kReasonMerged = 1,
  kReasonOutlier = 2,
  kReasonLonely = 3,      ///< a stray far from its neighbours
  kReasonOffSurface = 4,  ///< a stray on no surface of its neighbours
  kReasonThinned = 5,
};

struct OutlierRule {
  std::uint32_t neighbours = 16;
  double sigma = 2;
};

struct Outliers {
  std::uint64_t count = 0;
  double limit = 0;  ///< mean distance from which on samples are outliers, steps
};

/// Clears the masks of outliers; the samples they find cleared are not there. Slides over the store; memory holds the
/// positions of a dozen spacings of its height, an unnamed file in `directory` four bytes for each sample.
Outliers drop_outliers(const SlabStore& store, const OutlierRule& rule, const std::string& directory, KeepMasks& masks,
                       const RunContext& run);

}  // namespace lamina
