// Influence radii from local sampling density (METHOD 3.1): an octree of counts in a window that runs ahead of the
// surface.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "store/slab_store.h"

namespace lamina {

/// All lengths in fixed-point steps of the frame. Cells lie on multiples of their side, whatever the cloud.
struct RadiiSettings {
  std::int32_t finest_cell = 1;    ///< side of the finest counting cell (the octree's d_max), > 0. Best near the side
                                   ///< that holds min_samples where the cloud is dense: twice the radius there or a
                                   ///< little more. Smaller ones cost time and memory and gain nothing
  int levels = 5;                  ///< 1..31; sides finest_cell * 2^0 .. 2^(levels-1)
  std::uint32_t min_samples = 16;  ///< > 0; a sample takes the finest cell holding at least this many (METHOD 3.1), or
                                   ///< the coarsest one when none does
  float neighbour_bound = 1.5F;    ///< >= 1; a radius is at most this times the smallest one of the 27 cells around
};

/// Sliding estimator: push buckets of the store in ascending z, pop the radii of those whose surroundings are complete.
/// The result is a function of the cloud and the settings alone, not of how it was cut into buckets or of threads.
/// Keeps four bytes per sample in flight plus the counting cells; never the samples. In flight is what lies within two
/// coarsest cells below the last sample pushed, and what has not been popped.
///
/// The radius of a sample is 2 sqrt(A / N) of its cell (A: a side's area, N: samples in it), bounded at every level
/// from the finest up to that cell's: there the 27 cells around the sample's are looked at, and those which hold
/// min_samples (at the coarsest level: any) and have no child that does bound it by neighbour_bound times their own 2
/// sqrt(A / N). Cells refined further bound through their children alone, so that a step in density keeps its long
/// radii.
class RadiusEstimator {
 public:
  /// Throws Error(internal) for settings out of range.
  explicit RadiusEstimator(const RadiiSettings& settings);
  ~RadiusEstimator();
  RadiusEstimator(const RadiusEstimator&) = delete;
  RadiusEstimator& operator=(const RadiusEstimator&) = delete;
  /// The next bucket's samples: none may lie in a coarsest cell below that of the highest sample pushed so far, which
  /// ascending buckets never do (else Error(internal)). Throws Error(budget) beyond 2^26 blocks of 4^3 cells in flight.
  void push(const LocalSamples& samples);
  /// No more samples come: the radii of all buckets can be popped.
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
  float noise = 0;  ///< median distance of samples from the surface their neighbours suggest, in units of `median`
};
/// Looks at runs of buckets about evenly spaced samples, each run at least 16 radii tall, about `sample_limit` samples
/// in all (more when one run of that height holds more; a store of no more than the limit is read whole, as one
/// octree). Radii are not bounded by neighbours: clipped cells lengthen `high` by up to 2. Where the input gave radii
/// (layout has_radius) the quantiles are those of the given radii. Memory: 20 bytes per sample of a run. Throws nothing
/// of its own; all-zero radii when the store is empty or all samples coincide.
RadiusSurvey survey_radii(const SlabStore& store, std::uint64_t sample_limit, std::uint32_t min_samples = 16);

inline constexpr std::uint64_t kSurveySamples = 1u << 18;  ///< whose radii are looked at before streaming

/// The same where a bucket's samples come from elsewhere: `read` fills them in as SlabStore::read() does.
using ReadBucket = std::function<void(std::size_t bucket, LocalSamples& out)>;
RadiusSurvey survey_radii(const SlabStore& store, const ReadBucket& read, std::uint64_t sample_limit,
                          std::uint32_t min_samples = 16);

}  // namespace lamina
