#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <deque>
#include <limits>

#include "base/vectors.h"
#include "lamina/error.h"
#include "lattice/lattice.h"
#include "samples/cell_octree.h"
#include "samples/radius_estimator.h"

namespace lamina {
namespace {

/// A pushed bucket whose radii have not been taken.
struct WaitingBucket {
  std::vector<CellRef> refs;
  std::int64_t low = std::numeric_limits<std::int64_t>::max();   ///< first group with a sample of it
  std::int64_t high = std::numeric_limits<std::int64_t>::min();  ///< last one
};

constexpr std::int64_t kUnset = std::numeric_limits<std::int64_t>::min();

}  // namespace

struct RadiusEstimator::Impl {
  explicit Impl(const RadiiSettings& s) : settings(s), octree(s) {}

  /// Groups before `end` have all their samples: radii follow up to the last one whose neighbours are known.
  void advance(std::int64_t end, bool last);
  /// Drops the groups that neither radii to come nor buckets to be popped refer to.
  void forget();

  RadiiSettings settings;
  CellOctree octree;
  std::deque<WaitingBucket> waiting;
  std::int64_t complete = kUnset;     ///< groups before this one have all their samples
  std::int64_t final = kUnset;        ///< groups before this one have their radii
  std::int64_t highest = kUnset;      ///< last group with a sample
  std::vector<std::int32_t> x, y, z;  ///< finest cells of one push, kept for their memory
};

void RadiusEstimator::Impl::advance(std::int64_t end, bool last) {
  if (end > complete) octree.aggregate(complete, end);
  complete = std::max(complete, end);
  const std::int64_t final_end = last ? complete : complete - 1;
  if (final_end <= final) return;
  octree.find_radii(final, final_end);
  final = final_end;
  forget();
}

void RadiusEstimator::Impl::forget() {
  if (final == kUnset) return;
  std::int64_t needed = final - 1;
  for (const auto& bucket : waiting) needed = std::min(needed, bucket.low);
  octree.drop_below(needed);
}

RadiusEstimator::RadiusEstimator(const RadiiSettings& settings) {
  if (settings.finest_cell < 1 || settings.levels < 1 || settings.levels > 31 || settings.min_samples < 1 ||
      !(settings.neighbour_bound >= 1)) {
    throw Error(ExitCode::internal,
                fmt::format("radii: finest cell {}, levels {}, samples per cell {}, bound {}: the first "
                            "three must be positive, levels at most 31, the bound at least 1",
                            settings.finest_cell, settings.levels, settings.min_samples, settings.neighbour_bound));
  }
  impl_ = std::make_unique<Impl>(settings);
}

RadiusEstimator::~RadiusEstimator() = default;

void RadiusEstimator::push(const LocalSamples& samples) {
  Impl& s = *impl_;
  const std::size_t n = samples.size();
  WaitingBucket bucket;
  if (n > 0) {
    const auto [low, high] = least_and_greatest(samples.z);
    const FloorDivider cell(s.settings.finest_cell);
    const int shift = s.octree.group_shift();
    bucket.low = cell(low) >> shift;
    bucket.high = cell(high) >> shift;
    if (s.complete == kUnset) s.complete = s.final = bucket.low;
    if (bucket.low < s.complete) {
      throw Error(ExitCode::internal, "radii: buckets must be pushed in ascending z");
    }
    bucket.refs.resize(n);
    for (auto* cells : {&s.x, &s.y, &s.z}) cells->resize(n);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, kSampleGrain), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) s.x[i] = cell(samples.x[i]);
      for (std::size_t i = range.begin(); i < range.end(); ++i) s.y[i] = cell(samples.y[i]);
      for (std::size_t i = range.begin(); i < range.end(); ++i) s.z[i] = cell(samples.z[i]);
    });
    s.octree.count(s.x, s.y, s.z, bucket.refs);
    s.highest = std::max(s.highest, bucket.high);
  }
  const std::int64_t high = bucket.high;
  s.waiting.push_back(std::move(bucket));
  if (n > 0) s.advance(high, false);
}

void RadiusEstimator::finish() {
  if (impl_->highest != kUnset) impl_->advance(impl_->highest + 1, true);
}

bool RadiusEstimator::pop(std::vector<float>& radii) {
  Impl& s = *impl_;
  if (s.waiting.empty()) return false;
  const WaitingBucket& bucket = s.waiting.front();
  if (!bucket.refs.empty() && bucket.high >= s.final) return false;
  radii.resize(bucket.refs.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, radii.size(), kSampleGrain), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) radii[i] = s.octree.radius(bucket.refs[i]);
  });
  s.waiting.pop_front();
  s.forget();
  return true;
}

}  // namespace lamina
