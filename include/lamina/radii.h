// Influence radii from local sampling density (METHOD 3.1): an octree of counts in a window that runs ahead of the
// surface.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "lamina/slab_store.h"

namespace lamina {

/// All lengths in fixed-point steps of the frame.
struct RadiiSettings {
  std::int32_t finest_cell = 1;    ///< side of the finest counting cell (the octree's d_max)
  int levels = 5;                  ///< sides finest_cell * 2^0 .. 2^(levels-1)
  std::uint32_t min_samples = 16;  ///< a sample takes the finest cell holding at least this many (METHOD 3.1)
  float neighbour_bound =
      1.5F;  ///< a radius is at most this times the smallest one of the 27 cells around (DESIGN, trap 2)
};

/// Sliding estimator: push buckets of the store in ascending z, pop the radii of those whose surroundings are complete.
/// The result is a function of the cloud and the settings alone, not of how it was cut into buckets.
/// Keeps four bytes per sample in flight plus the counting cells; never the samples.
class RadiusEstimator {
 public:
  explicit RadiusEstimator(const RadiiSettings& settings);
  ~RadiusEstimator();
  RadiusEstimator(const RadiusEstimator&) = delete;
  RadiusEstimator& operator=(const RadiusEstimator&) = delete;
  /// The next bucket's samples. Samples may overlap earlier buckets' z range only within the bucket's own [z_lower,
  /// z_upper].
  void push(const LocalSamples& samples);
  void finish();
  /// Radii (steps) of the next pushed bucket, one per sample in its order; false when its surroundings are not
  /// complete.
  bool pop(std::vector<float>& radii);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Distribution of the density radius over a few buckets of the store, each seen at full density, with an octree of
/// unbounded depth: what the lattice's finest cell and number of levels are chosen from before streaming.
struct RadiusSurvey {
  std::uint64_t samples = 0;            ///< samples looked at
  float low = 0, median = 0, high = 0;  ///< 1 %, 50 %, 99 % quantiles, steps
};
/// Reads evenly spaced buckets until about `sample_limit` samples have been seen (a small store is read whole). Where
/// the input gave radii (layout has_radius) the quantiles are those of the given radii. Throws nothing of its own;
/// all-zero when the store is empty or all samples coincide.
RadiusSurvey survey_radii(const SlabStore& store, std::uint64_t sample_limit, std::uint32_t min_samples = 16);

}  // namespace lamina
