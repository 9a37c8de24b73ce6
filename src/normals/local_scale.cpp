#include "normals/local_scale.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lamina::normals {
namespace {

constexpr double kDegree = 0.017453292519943295;
constexpr double kUncertain = 2.5 * kDegree;  ///< first planes that are more certain than this stay
constexpr double kCertain = 1.5 * kDegree;    ///< goal
constexpr double kDeviations = 3.5;           ///< that two planes of one surface may differ by
constexpr double kSlack = 1 * kDegree;        ///< and besides
constexpr double kNoisy = 0.25;  ///< ratio of variances from which on the samples are a ball rather than a sheet
constexpr double kSteady = 1.2;  ///< growth of the residual, per level, that noise alone may show; an edge doubles it
constexpr double kMostSamples = 1024;
constexpr double kSlim = 0.6;  ///< ratio of variances along a sheet: ridges and spines are slimmer

/// Variance of a plane's tilt, radians^2: noise in the plane's own samples.
double tilt_variance(const Plane& plane, double samples) {
  const double gap = std::max(plane.middle - plane.least, 1e-6 * plane.most);
  return plane.least * plane.middle / (samples * gap * gap);
}

struct Estimate {
  Plane plane;
  double tilt = 0;
};

bool agree(const Estimate& a, const Estimate& b, double deviations2) {
  double cosine = 0;
  for (std::size_t i = 0; i < 3; ++i) cosine += double{a.plane.normal[i]} * double{b.plane.normal[i]};
  return 1 - cosine * cosine <= deviations2 * (a.tilt + b.tilt) + kSlack * kSlack;
}

/// Few samples of an even sheet may look slim.
bool is_slim(const Plane& plane, double samples) {
  return plane.middle < kSlim * (1 - 2 / std::sqrt(samples)) * plane.most;
}

}  // namespace

std::uint8_t choose_level(const SampleTree& tree, const FirstFit& first) {
  std::array<Estimate, kMostLevel + 1> estimates;
  estimates[0] = {first.plane, tilt_variance(first.plane, first.samples)};
  if (!first.plane.valid() || estimates[0].tilt <= kUncertain * kUncertain) return 0;
  std::uint8_t level = 0;
  while (level < kMostLevel && estimates[level].tilt > kCertain * kCertain) {
    const float squared = reach_of_level(first.squared, static_cast<std::uint8_t>(level + 1));
    if (squared > first.bound) break;
    Moments m;
    m.count = 1;
    tree.within(first.place, squared, [&](const Neighbour&, const std::array<float, 3>& offset) { m.add(offset); });
    const Estimate next{fit_plane(m), 0};
    const Plane& last = estimates[level].plane;
    if (!next.plane.valid() || is_slim(next.plane, m.count)) break;
    double deviations2 = kDeviations * kDeviations;
    if (last.least < kNoisy * last.middle && next.plane.least > kSteady * last.least) {
      const double steady = kSteady * last.least / next.plane.least;
      deviations2 *= steady * steady;
    }
    estimates[level + 1U] = {next.plane, tilt_variance(next.plane, m.count)};
    const bool fits = std::all_of(estimates.begin(), estimates.begin() + level + 1, [&](const Estimate& earlier) {
      return agree(earlier, estimates[level + 1U], deviations2);
    });
    if (!fits) break;
    ++level;
    if (m.count > kMostSamples) break;
  }
  return level;
}

float reach_of_level(float first_squared, std::uint8_t level) {
  return std::ldexp(first_squared, level);
}

Plane plane_within(const SampleTree& tree, std::uint32_t place, float squared) {
  Moments m;
  m.count = 1;
  tree.within(place, squared, [&](const Neighbour& n, const std::array<float, 3>& offset) {
    m.add(offset, 1 - double{n.squared} / double{squared});
  });
  return fit_plane(m);
}

}  // namespace lamina::normals
