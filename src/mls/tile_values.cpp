#include "mls/tile_values.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "mls/shared_corners.h"

namespace lamina {
namespace {

/// Whether a sample close enough contributed to a point.
bool is_seen(const Lanes* sums, int lane) {
  return sums[kW][lane] > 0 && sums[kNearest][lane] <= 1;
}

/// Normals contradict each other where their mean is shorter than this.
constexpr float kTorn = 0.5F;

/// Whether those that a seen point sees do.
bool is_torn(const Lanes* sums, int lane) {
  const float x = sums[kNx][lane];
  const float y = sums[kNy][lane];
  const float z = sums[kNz][lane];
  return x * x + y * y + z * z < kTorn * kTorn * sums[kW][lane] * sums[kW][lane];
}

bool any_seen(const Lanes* sums) {
  bool any = false;
  for (int l = 0; l < kLanes; ++l) any = any || is_seen(sums, l);
  return any;
}

/// A single sample is no surface: what sees no other counts as this far from it (support radii), too far for a corner
/// to stand on its own. All of one sample's corners lead to the same point, and triangles between them have no area.
constexpr float kAlone = 1;

/// Makes a corner's projected point the average of its samples, on the side where the fit has it: a fit that reaches
/// beyond its samples tells no more.
void keep_to_samples(const Lanes* sums, const FitInput& in, int l, FitOutput& fit) {
  if (sums[kSeen][l] < 2) fit.offset_from_mean[l] = std::max(fit.offset_from_mean[l], kAlone);
  const float inv = 1.0F / sums[kW][l];
  const float x = in.offset.x[l] - sums[kPx][l] * inv;
  const float y = in.offset.y[l] - sums[kPy][l] * inv;
  const float z = in.offset.z[l] - sums[kPz][l] * inv;
  const float d = std::sqrt(x * x + y * y + z * z);
  if (!(d > 1e-3F)) return;  // too near for a direction: the fit's point is as near
  const float side = fit.distance[l] < 0 ? -1.0F : 1.0F;
  fit.distance[l] = side * d;
  fit.nx[l] = side * x / d;
  fit.ny[l] = side * y / d;
  fit.nz[l] = side * z / d;
  fit.curvature[l] = 0;
}

}  // namespace

FitCounts fit_tile(const Kernel& kernel, const ProjectSettings& settings, std::size_t channels, const TileState& state,
                   const std::vector<Query>& queries, TileFit& out) {
  const std::size_t groups = state.all.points.size();
  out.fits.resize(std::max(groups, out.fits.size()));
  out.seen.assign(groups * kLanes, 0);
  out.trusted.assign(groups * kLanes, 0);
  FitCounts counts;
  for (std::size_t g = 0; g < groups; ++g) {
    const Lanes* sums = &state.all.sums[g * channels];
    if (!any_seen(sums)) continue;
    FitOutput& fit = out.fits[g];
    const FitInput in = fit_input(state, queries, g, settings.fit, shift_of(settings));
    kernel.fit(sums, in, fit);
    const int lanes = static_cast<int>(std::min<std::size_t>(kLanes, queries.size() - g * kLanes));
    for (int l = 0; l < lanes; ++l) {
      const bool has_normal = fit.nx[l] != 0 || fit.ny[l] != 0 || fit.nz[l] != 0;
      const bool seen = is_seen(sums, l) && has_normal;
      const bool trusted = seen && fit.offset_from_mean[l] <= settings.trusted_offset &&
                           sums[kSeen][l] >= static_cast<float>(settings.trusted_samples);
      if (seen && !trusted && !settings.centres) keep_to_samples(sums, in, l, fit);
      out.seen[g * kLanes + static_cast<std::size_t>(l)] = seen ? 1 : 0;
      out.trusted[g * kLanes + static_cast<std::size_t>(l)] = trusted ? 1 : 0;
      counts.seen += seen ? 1 : 0;
      counts.trusted += trusted ? 1 : 0;
      counts.torn += seen && is_torn(sums, l) ? 1 : 0;
    }
  }
  return counts;
}

void store_values(Window& window, int level, const Work& work, const std::vector<Query>& queries,
                  const TileState& state, const TileFit& fit) {
  Projected& points = *work.points;
  CornerBlock& leaf = *work.tile.leaf;
  const bool corners = work.points == work.tile.leaf;
  const std::size_t channels = kSums + static_cast<std::size_t>(window.attributes());
  for (int z = work.begin; z < work.end; ++z) {
    points.seen.words[z] = points.trusted.words[z] = 0;
    if (corners) leaf.outside.words[z] = 0;
  }
  for (std::size_t i = 0; i < queries.size(); ++i) {
    if (fit.seen[i] == 0) continue;
    const Query& q = queries[i];
    const std::uint64_t one = std::uint64_t{1} << (q.x + 8 * q.y);
    points.seen.words[q.z] |= one;
    if (fit.trusted[i] != 0) points.trusted.words[q.z] |= one;
    if (corners && fit.fits[i / kLanes].distance[static_cast<int>(i % kLanes)] >= 0) leaf.outside.words[q.z] |= one;
  }
  std::array<std::uint16_t, 512> numbers;  // of queries, by place
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Query& q = queries[i];
    numbers[static_cast<std::size_t>(BlockMask::offset(q.x, q.y, q.z))] = static_cast<std::uint16_t>(i);
  }
  std::uint32_t count = 0;
  for (int z = work.begin; z < work.end; ++z) {
    if (corners && level > 0) take_shared(window, level, work.tile, z);
    points.active.words[z] = points.seen.words[z];
    count += static_cast<std::uint32_t>(std::popcount(points.seen.words[z]));
  }
  CornerValues& values = points.values[window.slab_in_leaf(level, work.begin)];
  values.allocate(count, window.channels());
  const auto cell = static_cast<float>(window.lattice().cell_size(level));
  std::uint32_t at = 0;
  for (int z = work.begin; z < work.end; ++z) {
    const std::uint64_t shared = corners ? leaf.shared.words[z] : 0;
    for (std::uint64_t w = points.seen.words[z]; w != 0; w &= w - 1, ++at) {
      const int bit = std::countr_zero(w);
      if (((shared >> bit) & 1U) != 0) {
        copy_value(window, finer_corner(window, level, work.tile, z, bit), values, at);
        continue;
      }
      const std::size_t query = numbers[static_cast<std::size_t>(z * 64 + bit)];
      const std::size_t g = query / kLanes;
      const int l = static_cast<int>(query % kLanes);
      const FitOutput& out = fit.fits[g];
      const Lanes* sums = &state.all.sums[g * channels];
      float* const v = values.of(at);
      v[kDistance] = out.distance[l] * cell;
      v[kNormalX] = out.nx[l];
      v[kNormalY] = out.ny[l];
      v[kNormalZ] = out.nz[l];
      v[kCurvature] = out.curvature[l] / cell;
      v[kOffsetFromMean] = out.offset_from_mean[l];
      const float inv = 1.0F / sums[kW][l];
      for (int c = 0; c < window.attributes(); ++c) v[kFirstAttribute + c] = sums[kSums + c][l] * inv;
    }
  }
}

}  // namespace lamina
