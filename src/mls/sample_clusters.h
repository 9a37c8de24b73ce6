// A bucket's samples in the order in which tiles want them: in clusters, cubes of a few cells of the samples' own
// level, so that tiles look for clusters instead of samples.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "octree/window.h"
#include "samples/sample_feed.h"

namespace lamina {

/// Samples that lie together, and the box that their supports reach (steps).
struct SampleCluster {
  std::uint32_t begin = 0, end = 0;
  std::array<std::int32_t, 3> low{}, high{};
};

/// What projection needs of a sample that acts on a tile.
struct ClusterSample {
  float nx, ny, nz;  ///< unit normal
  float weight, band;
};

/// A bucket's samples in clusters; those without a support are left out.
struct ClusteredBucket {
  /// Where they lie (steps) and how far they act: what tells whether a sample acts on a tile. Most of those looked at
  /// do not, so that four are looked at together, and the rest of their numbers stays where it is.
  std::vector<std::int32_t> x, y, z;
  std::vector<float> support;
  /// These arrays are so much longer than there are samples.
  static constexpr std::size_t kBehind = 3;

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

}  // namespace lamina
