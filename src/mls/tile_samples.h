// A bucket's samples in the order in which tiles want them: in clusters, cubes of a few cells of the samples' own
// level, so that tiles look for clusters instead of samples; and those that a tile takes, in rows.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/four.h"
#include "mls/kernel.h"
#include "octree/window.h"
#include "samples/sample_feed.h"

namespace lamina {

/// Samples that lie together, and the box that their supports reach (steps).
struct SampleCluster {
  std::uint32_t begin = 0, end = 0;
  std::array<std::int32_t, 3> low{}, high{};
};

/// What projection needs of a sample.
struct ClusterSample {
  std::int32_t x, y, z;  ///< steps
  float support;         ///< as in ActiveBucket, like the last two
  float nx, ny, nz;      ///< unit normal
  float weight, band;
};

/// A bucket's samples in clusters; those without a support are left out.
struct ClusteredBucket {
  std::vector<ClusterSample> samples;
  /// One array per attribute and, where residuals are known, two more: the residual (steps) and its square.
  std::vector<std::vector<float>> attributes;
  std::vector<SampleCluster> clusters;
};

/// Memory of cluster_samples(), kept from bucket to bucket.
struct ClusterScratch {
  struct Keyed {
    std::uint64_t key;  ///< number of the cube
    std::uint32_t sample;
  };
  std::vector<Keyed> keyed, other;
};

/// Canonical order: clusters by level, then z, y, x; inside a cluster as in the bucket. What `out` held before is gone,
/// its storage used again.
void cluster_samples(const ActiveBucket& bucket, const Lattice& lattice, ClusterScratch& scratch, ClusteredBucket& out);
inline ClusteredBucket cluster_samples(const ActiveBucket& bucket, const Lattice& lattice) {
  ClusterScratch scratch;
  ClusteredBucket out;
  cluster_samples(bucket, lattice, scratch, out);
  return out;
}

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

// The samples that can reach a tile's points, gathered in rows as the kernel reads them.

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
  void place(const Lattice& lattice, int level, std::span<const Run> runs);

  TileSamples samples_;
  float max_support_ = 0;
  std::vector<Found> found_;  ///< the first `count_` of them
  std::size_t count_ = 0;
  std::vector<std::uint32_t> row_begin_;
};

}  // namespace lamina
