// A bucket's samples in the order in which tiles want them: in clusters, cubes of a few cells of the samples' own
// level, so that tiles look for clusters instead of samples.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "samples/sample_feed.h"

namespace lamina {

/// Samples that lie together, and the box that their supports reach (steps).
struct SampleCluster {
  std::uint32_t begin = 0, end = 0;
  std::array<std::int32_t, 3> low{}, high{};
};

/// What projection needs of a bucket's samples; those without a support are left out.
struct ClusteredBucket {
  std::vector<std::int32_t> x, y, z;           ///< steps
  std::vector<float> nx, ny, nz;               ///< unit normals
  std::vector<float> support, weight;          ///< as in ActiveBucket
  std::vector<float> cell;                     ///< of the sample's level, steps
  std::vector<std::vector<float>> attributes;  ///< one array per attribute
  std::vector<SampleCluster> clusters;
};

/// Canonical order: clusters by level, then z, y, x; inside a cluster as in the bucket.
ClusteredBucket cluster_samples(const ActiveBucket& bucket, const Lattice& lattice);

}  // namespace lamina
