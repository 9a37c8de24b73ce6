#include "mls/tile_values.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>

namespace lamina {
namespace {

/// Of the support's own disc, what is left of it at least where it cuts the samples' plane far from its middle.
constexpr float kLeastDisc = 0.25F;

/// Whether the normals of the samples that a seen point sees contradict each other.
bool is_torn(const Lanes* sums, int lane) {
  const float x = sums[kNx][lane];
  const float y = sums[kNy][lane];
  const float z = sums[kNz][lane];
  return x * x + y * y + z * z < kTorn * kTorn * sums[kW][lane] * sums[kW][lane];
}

/// What became of a group's points, a bit each.
struct LaneStates {
  unsigned seen = 0;     ///< a sample close enough contributed, and there is a normal
  unsigned trusted = 0;  ///< of these, whose fit is believed
  unsigned torn = 0;     ///< of these, whose samples' normals contradict each other
};

unsigned one_if(bool holds) {
  return static_cast<unsigned>(holds);
}

/// Of the first so many. Without branches: which points are what is as good as random.
LaneStates states_of(const Lanes* sums, const FitOutput& fit, const ProjectSettings& settings, int lanes) {
  const auto samples = static_cast<float>(settings.trusted_samples);
  LaneStates out;
  for (int l = 0; l < kLanes; ++l) {
    const unsigned has_normal = one_if(fit.nx[l] != 0) | one_if(fit.ny[l] != 0) | one_if(fit.nz[l] != 0);
    out.seen |= (one_if(sums[kW][l] > 0) & one_if(sums[kNearest][l] <= 1) & has_normal) << l;
    out.trusted |= (one_if(fit.offset_from_mean[l] <= settings.trusted_offset) & one_if(sums[kSeen][l] >= samples))
                   << l;
    out.torn |= one_if(is_torn(sums, l)) << l;
  }
  out.seen &= (1U << lanes) - 1;
  out.trusted &= out.seen;
  out.torn &= out.seen;
  return out;
}

/// Whether samples close enough contributed to any point of a group.
bool any_seen(const Lanes* sums) {
  unsigned any = 0;
  for (int l = 0; l < kLanes; ++l) any |= one_if(sums[kW][l] > 0) & one_if(sums[kNearest][l] <= 1);
  return any != 0;
}

/// Samples per cell^2 of the surface around a seen point: those within its support lie on the disc that this cuts out
/// of their plane.
float density(const Lanes* sums, int l) {
  const float inv = 1.0F / sums[kW][l];
  const float support = sums[kWR][l] * inv;
  const float height = sums[kPN][l] * inv;
  const float square = support * support;
  return sums[kSeen][l] / (std::numbers::pi_v<float> * std::max(square - height * height, kLeastDisc * square));
}

/// How much farther out than its fit the surface lies, cells: the mean residual of the samples, where their scatter
/// does not make it. Adding what a smooth fit leaves, smoothed, takes most of its error away (Tukey 1977: twicing).
float left_out(const Lanes* sums, const ProjectRule& rule, int l, float offset_from_mean) {
  const Lanes* const residuals = sums + rule.channels - kResidualSums;
  const float inv = 1.0F / sums[kW][l];
  const float mean = residuals[0][l] * inv;
  const float mean2 = mean * mean;
  const float chance = kResidualShare * kResidualShare * std::max(residuals[1][l] * inv - mean2, 0.0F);
  const float both = mean2 * mean2 + chance * chance;
  if (!(both > 0)) return 0;
  const float around = std::max(1 - offset_from_mean / kResidualOffset, 0.0F);
  const float size = std::abs(mean) / (kMostResidual * sums[kWR][l] * inv * rule.cell);
  const float near = std::max(1 - size * size, 0.0F);
  return around * near * near * mean * (mean2 * mean2 / both) / rule.cell;
}

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

/// Puts what a point's sheets say in place of its fit, provided that it can be trusted.
void take_crease(const Crease& crease, TileFit& out, ProjectCounts& counts) {
  const SheetsValue& value = crease.value;
  const double offset = meshes::norm(value.lean) / crease.support;
  if (out.seen[crease.query] == 0 || offset > kMostLean) return;
  FitOutput& fit = out.fits[crease.query / kLanes];
  const int l = static_cast<int>(crease.query % kLanes);
  fit.distance[l] = static_cast<float>(value.distance);
  fit.nx[l] = static_cast<float>(value.normal[0]);
  fit.ny[l] = static_cast<float>(value.normal[1]);
  fit.nz[l] = static_cast<float>(value.normal[2]);
  fit.curvature[l] = static_cast<float>(value.curvature);
  fit.offset_from_mean[l] = static_cast<float>(offset);
  fit.lean_x[l] = static_cast<float>(value.lean[0] / crease.support);
  fit.lean_y[l] = static_cast<float>(value.lean[1] / crease.support);
  fit.lean_z[l] = static_cast<float>(value.lean[2] / crease.support);
  counts.trusted += out.trusted[crease.query] == 0 ? 1 : 0;
  out.trusted[crease.query] = 1;
  if (!value.creased) return;
  if (out.creases.empty()) out.creases.resize(out.seen.size());
  out.creases[crease.query] = packed_crease(value.crease, value.crease_normal);
}

/// Takes over `seen`, `trusted` and the signs of a layer's shared corners that are active.
void take_shared(const Window& window, int level, const Tile& tile, int z) {
  CornerBlock& leaf = *tile.leaf;
  for (std::uint64_t w = leaf.shared.words[z] & leaf.active.words[z]; w != 0; w &= w - 1) {
    const FinerCorner from = finer_corner(window, level, tile, z, std::countr_zero(w));
    const std::uint64_t one = w & (~w + 1);
    if (!from.block->seen.test(from.offset)) continue;
    leaf.seen.words[z] |= one;
    if (from.block->trusted.test(from.offset)) leaf.trusted.words[z] |= one;
    if (from.block->outside.test(from.offset)) leaf.outside.words[z] |= one;
    if (from.block->creased.test(from.offset)) leaf.creased.words[z] |= one;
  }
}

/// Copies the finer level's values to place `at` of the coarser one's.
void copy_value(const Window& window, const FinerCorner& from, CornerValues& to, std::uint32_t at) {
  const CornerValues& source = from.block->values[window.slab_in_leaf(from.level, from.offset >> 6)];
  const std::uint32_t i = from.block->value_index(from.offset, window.slab_layers(from.level));
  std::copy_n(source.of(i), window.channels(), to.of(at));
}

}  // namespace

void fit_tile(const ProjectRule& rule, const TileState& state, const std::vector<Query>& queries,
              const std::vector<Crease>& creases, TileFit& out, ProjectCounts& counts) {
  const ProjectSettings& settings = rule.settings;
  const std::size_t groups = state.all.points.size();
  out.fits.resize(std::max(groups, out.fits.size()));
  out.seen.assign(groups * kLanes, 0);
  out.trusted.assign(groups * kLanes, 0);
  counts.corners += queries.size();
  counts.sums += state.sums;
  for (std::size_t g = 0; g < groups; ++g) {
    const Lanes* sums = &state.all.sums[g * rule.channels];
    if (!any_seen(sums)) continue;
    FitOutput& fit = out.fits[g];
    const FitInput in = fit_input(rule, state, queries, g);
    rule.kernel.fit(sums, in, fit);
    const int lanes = static_cast<int>(std::min<std::size_t>(kLanes, queries.size() - g * kLanes));
    const LaneStates states = states_of(sums, fit, settings, lanes);
    for (int l = 0; l < lanes; ++l) {
      out.seen[g * kLanes + static_cast<std::size_t>(l)] = static_cast<std::uint8_t>((states.seen >> l) & 1U);
      out.trusted[g * kLanes + static_cast<std::size_t>(l)] = static_cast<std::uint8_t>((states.trusted >> l) & 1U);
    }
    counts.seen += static_cast<std::uint64_t>(std::popcount(states.seen));
    counts.trusted += static_cast<std::uint64_t>(std::popcount(states.trusted));
    counts.torn += static_cast<std::uint64_t>(std::popcount(states.torn));
    for (unsigned w = settings.residuals ? states.trusted : 0; w != 0; w &= w - 1) {
      const int l = std::countr_zero(w);
      fit.distance[l] -= left_out(sums, rule, l, fit.offset_from_mean[l]);
    }
    for (unsigned w = settings.centres ? 0 : states.seen & ~states.trusted; w != 0; w &= w - 1)
      keep_to_samples(sums, in, std::countr_zero(w), fit);
  }
  out.creases.clear();
  for (const Crease& c : creases) take_crease(c, out, counts);
}

void store_values(const ProjectRule& rule, Window& window, const Work& work, const std::vector<Query>& queries,
                  const TileState& state, const TileFit& fit) {
  const int level = work.level;
  Projected& points = *work.points;
  CornerBlock& leaf = *work.tile.leaf;
  const bool corners = work.corners();
  const auto [begin, end] = work.layers;
  // Without branches: which are seen, trusted and outside is as good as random.
  BlockMask seen, trusted, outside, creased;
  std::array<std::uint16_t, 512> numbers;  // of queries, by place
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Query& q = queries[i];
    const int bit = q.x + 8 * q.y;
    const std::uint64_t is_seen = fit.seen[i];
    const bool positive = fit.fits[i / kLanes].distance[static_cast<int>(i % kLanes)] >= 0;
    seen.words[q.z] |= is_seen << bit;
    trusted.words[q.z] |= (is_seen & fit.trusted[i]) << bit;
    outside.words[q.z] |= (is_seen & static_cast<std::uint64_t>(positive)) << bit;
    numbers[static_cast<std::size_t>(BlockMask::offset(q.x, q.y, q.z))] = static_cast<std::uint16_t>(i);
  }
  for (std::size_t i = 0; i < fit.creases.size(); ++i) {
    if (fit.seen[i] == 0 || fit.creases[i] == std::array<float, 2>{}) continue;
    creased.set(BlockMask::offset(queries[i].x, queries[i].y, queries[i].z));
  }
  for (int z = begin; z < end; ++z) {
    points.seen.words[z] = seen.words[z];
    points.trusted.words[z] = trusted.words[z];
    if (!corners) continue;
    leaf.outside.words[z] = outside.words[z];
    leaf.creased.words[z] = creased.words[z];
  }
  std::uint32_t count = 0;
  for (int z = begin; z < end; ++z) {
    if (corners && level > 0) take_shared(window, level, work.tile, z);
    points.active.words[z] = points.seen.words[z];
    count += static_cast<std::uint32_t>(std::popcount(points.seen.words[z]));
  }
  CornerValues& values = points.values[window.slab_in_leaf(level, begin)];
  values.allocate(count, window.channels());
  const float cell = rule.cell;
  const int first = window.first_attribute();
  std::uint32_t at = 0;
  for (int z = begin; z < end; ++z) {
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
      const Lanes* sums = &state.all.sums[g * rule.channels];
      float* const v = values.of(at);
      v[kDistance] = out.distance[l] * cell;
      v[kNormalX] = out.nx[l];
      v[kNormalY] = out.ny[l];
      v[kNormalZ] = out.nz[l];
      v[kCurvature] = out.curvature[l] / cell;
      v[kOffsetFromMean] = out.offset_from_mean[l];
      if (window.has_rare()) {
        v[kLean] = rule.settings.leans ? packed_lean({out.lean_x[l], out.lean_y[l], out.lean_z[l]}) : 0.0F;
        v[kDensity] = rule.settings.densities ? density(sums, l) / (cell * cell) : 0.0F;
        v[kCrease] = fit.creases.empty() ? 0.0F : fit.creases[query][0];
        v[kCreaseEnd] = fit.creases.empty() ? 0.0F : fit.creases[query][1];
      }
      const float inv = 1.0F / sums[kW][l];
      for (int c = 0; c < window.attributes(); ++c) v[first + c] = sums[kSums + c][l] * inv;
    }
  }
}

bool allocate_values(const Window& window, int level, Projected& points, LeafLayers layers) {
  std::uint32_t active = 0;
  for (int z = layers.begin; z < layers.end; ++z)
    active += static_cast<std::uint32_t>(std::popcount(points.active.words[z]));
  if (active == 0) return false;
  CornerValues& values = points.values[window.slab_in_leaf(level, layers.begin)];
  values.allocate(active, window.channels());
  std::ranges::fill(values.all(), 0.0F);
  return true;
}

void copy_shared(Window& window, int level, const Tile& tile, LeafLayers layers) {
  CornerBlock& leaf = *tile.leaf;
  CornerValues& values = leaf.values[window.slab_in_leaf(level, layers.begin)];
  for (int z = layers.begin; z < layers.end; ++z) {
    take_shared(window, level, tile, z);
    for (std::uint64_t w = leaf.shared.words[z] & leaf.seen.words[z]; w != 0; w &= w - 1) {
      const int bit = std::countr_zero(w);
      copy_value(window, finer_corner(window, level, tile, z, bit), values,
                 leaf.value_index(z * 64 + bit, window.slab_layers(level)));
    }
  }
}

}  // namespace lamina
