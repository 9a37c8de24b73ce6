// The samples that can reach a tile's points, gathered in rows as the kernel reads them.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/four.h"
#include "mls/kernel.h"
#include "mls/sample_clusters.h"
#include "octree/window.h"

namespace lamina {

/// A tile's samples sorted by rows of cells (z, then y; inside a row in the order of the runs).
class RowSamples {
 public:
  static constexpr int kLow =
      -4;  ///< rows of cells kLow .. kLow + kRows - 1 relative to the tile; outer ones are clamped
  static constexpr int kRows = 16;

  /// Takes the samples that can reach a point of the block.
  void gather(const Lattice& lattice, const QueryLayers& layers, const Block& block, std::span<const Run> runs);
  /// Makes the supports so many times as wide, up to 1, until samples are gathered anew.
  void scale_supports(float factor);
  /// The arrays may be longer than size().
  [[nodiscard]] const TileSamples& samples() const { return samples_; }
  [[nodiscard]] std::size_t size() const { return count_; }
  /// Ranges of samples within the largest support of a box (cells relative to the tile); `out` has kRows entries.
  int ranges(float y_lo, float y_hi, float z_lo, float z_hi, SampleRange* out) const;

 private:
  /// A sample on its way into its row.
  struct Found {
    FourFloats at;  ///< x, y, z and the support: cells, relative to the tile
    const ClusterSample* sample;
    std::int32_t row;
    std::uint32_t run;
  };
  void select(const Lattice& lattice, const QueryLayers& layers, const Block& block, std::span<const Run> runs);
  void find_rows(const Lattice& lattice, int level, const Block& block, std::span<const Run> runs);
  void place(const Lattice& lattice, int level, std::span<const Run> runs);

  TileSamples samples_;
  float max_support_ = 0;
  std::vector<std::uint32_t> kept_;      ///< their numbers in their buckets, the first `count_` of them
  std::vector<std::uint32_t> kept_end_;  ///< so many are of the runs up to this one
  std::vector<Found> found_;             ///< the same in the end
  std::size_t count_ = 0;
  std::vector<std::uint32_t> row_begin_;
};

}  // namespace lamina
