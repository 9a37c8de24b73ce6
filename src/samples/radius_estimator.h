// Influence radii from local sampling density (Cuccuru et al. 2009, section 3.1): an octree of counts in a window that
// runs ahead of the surface.
#pragma once
#include <cstddef>
#include <cstdint>
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
  std::uint32_t min_samples = 16;  ///< > 0; a sample takes the finest cell holding at least this many (Cuccuru et
                                   ///< al. 2009, section 3.1), or the coarsest one when none does
  /// >= 1; a radius is at most this times the smallest one of the 27 cells around. Counts of 16 scatter by a quarter,
  /// radii by an eighth: bounds nearer to 1 would cut evenly sampled surfaces, wider ones leave the long radii of cells
  /// that the surface merely clips.
  float neighbour_bound = 1.5F;
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

}  // namespace lamina
