// Finding the samples of a tile: binning clusters, and gathering samples in rows.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "mls/kernel.h"
#include "mls/sample_clusters.h"
#include "octree/window.h"

namespace lamina {

using ClusteredBatch = std::vector<std::shared_ptr<const ClusteredBucket>>;

/// Samples [begin, end) of a bucket.
struct Run {
  const ClusteredBucket* from = nullptr;
  std::uint32_t begin = 0, end = 0;
};

/// Runs per tile, compressed rows: tile t owns runs[begin[t] .. begin[t + 1]), in the order of the batch.
struct TileRuns {
  std::vector<std::uint32_t> begin;
  std::vector<Run> runs;
  [[nodiscard]] std::span<const Run> of(std::size_t tile) const {
    return {runs.data() + begin[tile], runs.data() + begin[tile + 1]};
  }
};

/// Points of a level to look for: those of the layers [first, end), `shift` cells above the corners (0: corners, 0.5:
/// cell centres). Supports are taken `margin` steps longer than they are.
struct QueryLayers {
  int level = 0;
  std::int32_t first = 0, end = 0;
  float margin = 0;
  float shift = 0;
};

/// The clusters that may reach a point of each tile. `tiles` are distinct and in canonical order (z, y, x).
/// Deterministic for any number of threads.
TileRuns bin_clusters(const Lattice& lattice, const QueryLayers& layers, const ClusteredBatch& batch,
                      std::span<const Block> tiles);

/// A tile's samples sorted by rows of cells (z, then y; inside a row in the order of the runs).
class RowSamples {
 public:
  static constexpr int kLow =
      -4;  ///< rows of cells kLow .. kLow + kRows - 1 relative to the tile; outer ones are clamped
  static constexpr int kRows = 16;

  /// Takes the samples that can reach a point of the block. `band`: ProjectSettings::band.
  void gather(const Lattice& lattice, const QueryLayers& layers, const Block& block, std::span<const Run> runs,
              float band);
  [[nodiscard]] const TileSamples& samples() const { return samples_; }
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
  std::vector<Found> found_;
  std::vector<std::uint32_t> row_begin_;
};

}  // namespace lamina
