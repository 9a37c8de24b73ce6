// The density radii of a part of the cloud held in memory, by an octree of unbounded depth.
#pragma once
#include <cstdint>
#include <vector>

#include "store/slab_store.h"

namespace lamina {

/// A radius and how many samples have it.
struct WeightedRadius {
  float radius;
  std::uint64_t samples;
};

/// Whether more samples of the cloud lie below, and above.
struct CutEnds {
  bool below = false, above = false;
};

/// Radii (steps) of the samples, shortest first: 2 sqrt(A / N) of the smallest cells that hold `min_samples`, without
/// bounds by neighbours. Samples at the place of another count once. Only positions are looked at.
std::vector<WeightedRadius> density_radii(const LocalSamples& samples, CutEnds cut, std::uint32_t min_samples);

std::uint64_t samples_of(const std::vector<WeightedRadius>& radii);
/// The radius below which a share of `total` samples lies; `sorted` is not empty.
float quantile(const std::vector<WeightedRadius>& sorted, std::uint64_t total, double share);

}  // namespace lamina
