// The samples that can reach a tile's points, gathered in rows as the kernel reads them.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "mls/kernel.h"
#include "mls/sample_clusters.h"

namespace lamina {

/// A tile's samples sorted by rows of cells (z, then y; inside a row in the order of the runs).
class RowSamples {
 public:
  static constexpr int kLow =
      -4;  ///< rows of cells kLow .. kLow + kRows - 1 relative to the tile; outer ones are clamped
  static constexpr int kRows = 16;

  /// Takes the samples that can reach a point of the block. `band`: ProjectSettings::band.
  void gather(const Lattice& lattice, const QueryLayers& layers, const Block& block, std::span<const Run> runs,
              float band);
  /// The arrays may be longer than size().
  [[nodiscard]] const TileSamples& samples() const { return samples_; }
  [[nodiscard]] std::size_t size() const { return count_; }
  /// Ranges of samples within the largest support of a box (cells relative to the tile); `out` has kRows entries.
  int ranges(float y_lo, float y_hi, float z_lo, float z_hi, SampleRange* out) const;

 private:
  /// A sample on its way into its row; lengths in cells, relative to the tile.
  struct Found {
    float x, y, z, support;
    std::int32_t row;
    std::uint32_t run, sample;
  };
  void select(const Lattice& lattice, const QueryLayers& layers, const Block& block, std::span<const Run> runs);
  void place(const Lattice& lattice, int level, std::span<const Run> runs, float band);

  TileSamples samples_;
  float max_support_ = 0;
  std::vector<Found> found_;  ///< the first `count_` of them
  std::size_t count_ = 0;
  std::vector<std::uint32_t> row_begin_;
};

}  // namespace lamina
