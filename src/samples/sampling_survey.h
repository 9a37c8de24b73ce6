// What a few runs of buckets tell of a cloud before it is streamed: how densely it is sampled, and how noisy it is.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "samples/bucket_runs.h"
#include "store/slab_store.h"

namespace lamina {

/// Distribution of the density radius over a few buckets of the store, each seen at full density, with an octree of
/// unbounded depth: what the lattice's finest cell and number of levels are chosen from before streaming.
struct RadiusSurvey {
  std::uint64_t samples = 0;            ///< samples looked at
  float low = 0, median = 0, high = 0;  ///< 1 %, 50 %, 99 % quantiles, steps
  float noise = 0;  ///< median distance of samples from the surface their neighbours suggest, in units of `median`
  float normal_noise = 0;  ///< median angle of samples' normals to that surface's, radians
  /// Share of samples whose normals are far from their neighbours' places and near those of several sides: interpolated
  /// over a sharp edge (samples/consensus_plane.h).
  float blurred = 0;
  /// Share of samples whose neighbours do not lie on all sides (AllRound) within 1.4 `median`: on lines, at rims.
  float lopsided = 0;
  /// Share of samples around which the number of others grows with the distance as along a line, not as on a surface.
  float lined = 0;
  float high_noise = 0;  ///< a tenth of samples lies farther from that surface, in units of `median`
  /// The noisiest of a few stretches of the cloud: the median there, and its middle, steps.
  float worst_noise = 0;
  std::array<float, 3> noisiest{};
};
/// Looks at runs of buckets about evenly spaced samples, each run at least 16 radii tall, about `sample_limit` samples
/// in all (more when one run of that height holds more; a store of no more than the limit is read whole, as one
/// octree). Radii are not bounded by neighbours: clipped cells lengthen `high` by up to 2. Where the input gave radii
/// (layout has_radius) the quantiles are those of the given radii. Memory: 32 bytes per sample of a run. Throws nothing
/// of its own; all-zero radii when the store is empty or all samples coincide.
RadiusSurvey survey_radii(const SlabStore& store, std::uint64_t sample_limit, std::uint32_t min_samples = 16);

/// The same without a look at the noise.
RadiusSurvey survey_density(const SlabStore& store, std::uint64_t sample_limit, std::uint32_t min_samples = 16);

inline constexpr std::uint64_t kSurveySamples = 1u << 18;  ///< whose radii are looked at before streaming

/// The same where a bucket's samples come from elsewhere.
RadiusSurvey survey_radii(const SlabStore& store, const ReadBucket& read, std::uint64_t sample_limit,
                          std::uint32_t min_samples = 16);

struct Noise {
  float distance = 0;               ///< in units of the median radius
  float angle = 0;                  ///< of normals, radians, 0 to pi / 2
  float blurred = 0;                ///< RadiusSurvey::blurred
  float lopsided = 0;               ///< RadiusSurvey::lopsided
  float lined = 0;                  ///< RadiusSurvey::lined
  float high = 0;                   ///< a tenth of the samples has a larger distance
  float worst = 0;                  ///< median distance in the stretch where it is largest
  std::array<float, 3> worst_at{};  ///< the middle of that stretch, steps
};
/// Medians over some hundred samples: of the distance to the plane, or sphere, that their neighbours within two radii
/// suggest, in units of `radius` (the cloud's median radius, steps). Exact samples of a surface that the radius
/// resolves have under 0.02; uniform noise of half a local spacing either way on each coordinate has some 0.1. The
/// neighbours' positions decide, not the samples' own normals, whose angle to that surface's is the second. A function
/// of the store alone; reads about 2^17 samples, and at most four runs of buckets. 0 where too few samples have
/// neighbours to tell.
Noise survey_noise(const SlabStore& store, const ReadBucket& read, float radius);

// The density radii of a part of the cloud held in memory, by an octree of unbounded depth.

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
