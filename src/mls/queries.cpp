#include "mls/queries.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace lamina {
namespace {

struct Point {
  float x, y, z;
};

Point point_of(const Query& q, float shift) {
  return {static_cast<float>(q.x) + shift, static_cast<float>(q.y) + shift, static_cast<float>(q.z) + shift};
}

/// Puts points into groups and clears their sums.
template <typename At>
void fill(QueryBatch& batch, std::size_t count, std::size_t channels, const At& at) {
  const std::size_t groups = (count + kLanes - 1) / kLanes;
  batch.points.resize(groups);
  batch.facing.clear();
  for (std::size_t g = 0; g < groups; ++g) {
    for (int l = 0; l < kLanes; ++l) {
      const Point p = at(std::min(g * kLanes + static_cast<std::size_t>(l), count - 1));
      batch.points[g].x[l] = p.x;
      batch.points[g].y[l] = p.y;
      batch.points[g].z[l] = p.z;
    }
  }
  batch.sums.assign(groups * channels, Lanes{});
  for (std::size_t g = 0; g < groups; ++g) batch.sums[g * channels + kNearest].v.fill(1e30F);
}

/// From the points of a group to their corners; `number` tells the query of the batch's i-th point.
template <typename Number>
FitInput offsets(const QueryBatch& batch, const std::vector<Query>& queries, std::size_t g, std::size_t count, Fit fit,
                 float shift, const Number& number) {
  FitInput in;
  in.sphere = fit == Fit::sphere;
  for (int l = 0; l < kLanes; ++l) {
    const std::size_t i = std::min(g * kLanes + static_cast<std::size_t>(l), count - 1);
    const Point corner = point_of(queries[number(i)], shift);
    in.offset.x[l] = corner.x - batch.points[g].x[l];
    in.offset.y[l] = corner.y - batch.points[g].y[l];
    in.offset.z[l] = corner.z - batch.points[g].z[l];
  }
  return in;
}

/// Whether the samples a point sees lie on two sheets, facing opposite ways, that the lattice can tell apart: `active`
/// has the sums of those on the point's own side.
bool is_apart(const ProjectSettings& settings, const Lanes* all, int lane, const Lanes* near, int l) {
  const float w_near = near[kW][l];
  const float w_far = all[kW][lane] - w_near;
  if (w_near <= 0 || w_far <= 0) return false;
  float apart = 0;
  float n2 = 0;
  float against = 0;
  float far2 = 0;
  for (int k = 0; k < 3; ++k) {
    const float n = near[kNx + k][l];
    const float far = all[kNx + k][lane] - n;
    apart += n * ((all[kPx + k][lane] - near[kPx + k][l]) / w_far - near[kPx + k][l] / w_near);
    n2 += n * n;
    against += n * far;
    far2 += far * far;
  }
  const float n = std::sqrt(n2);
  return std::abs(apart) >= settings.apart * n && against < -0.7F * n * std::sqrt(far2);
}

}  // namespace

void list_queries(const Work& work, std::vector<Query>& out) {
  out.clear();
  const bool corners = work.points == work.tile.leaf;
  const auto wanted = [&](int z) {
    if (z < work.begin || z >= work.end) return std::uint64_t{0};
    return work.points->active.words[z] & ~(corners ? work.tile.leaf->shared.words[z] : 0);
  };
  for (int z = work.begin & ~1; z < work.end; z += 2) {
    const std::array<std::uint64_t, 2> layers{wanted(z), wanted(z + 1)};
    for (int y = 0; y < 8; y += 2) {
      if ((((layers[0] | layers[1]) >> (8 * y)) & 0xFFFF) == 0) continue;
      for (int i = 0; i < 8; i += 2) {
        // To and fro: what follows lies beside.
        const int x = (y & 2) == 0 ? i : 6 - i;
        const std::uint64_t group = std::uint64_t{0x0303} << (x + 8 * y);
        for (int k = 0; k < 2; ++k) {
          for (std::uint64_t w = layers[static_cast<std::size_t>(k)] & group; w != 0; w &= w - 1) {
            const int bit = std::countr_zero(w);
            out.push_back({static_cast<std::uint8_t>(bit & 7), static_cast<std::uint8_t>(bit >> 3),
                           static_cast<std::uint8_t>(z + k)});
          }
        }
      }
    }
  }
}

void start(TileState& state, const std::vector<Query>& queries, std::size_t channels, float shift) {
  fill(state.all, queries.size(), channels, [&](std::size_t i) { return point_of(queries[i], shift); });
  state.stepped = false;
  state.sums = queries.size();
}

void accumulate(const Kernel& kernel, const RowSamples& rows, TileState& state, std::size_t channels) {
  QueryBatch& batch = state.stepped ? state.moved : state.all;
  std::array<SampleRange, RowSamples::kRows> ranges{};
  for (std::size_t g = 0; g < batch.points.size(); ++g) {
    const Queries& q = batch.points[g];
    const auto [y_lo, y_hi] = std::minmax_element(q.y.v.begin(), q.y.v.end());
    const auto [z_lo, z_hi] = std::minmax_element(q.z.v.begin(), q.z.v.end());
    const int n = rows.ranges(*y_lo, *y_hi, *z_lo, *z_hi, ranges.data());
    if (batch.facing.empty()) {
      kernel.accumulate(rows.samples(), ranges.data(), n, q, &batch.sums[g * channels]);
    } else {
      kernel.accumulate_facing(rows.samples(), ranges.data(), n, q, batch.facing[g], &batch.sums[g * channels]);
    }
  }
}

FitInput fit_input(const TileState& state, const std::vector<Query>& queries, std::size_t g, Fit fit, float shift) {
  return offsets(state.all, queries, g, queries.size(), fit, shift, [](std::size_t i) { return i; });
}

bool advance(const Kernel& kernel, const ProjectSettings& settings, TileState& state, const std::vector<Query>& queries,
             std::size_t channels, int pass) {
  const float shift = shift_of(settings);
  const QueryBatch& from = state.stepped ? state.moved : state.all;
  const std::size_t count = state.stepped ? state.moving.size() : queries.size();
  const auto number = [&](std::size_t i) { return state.stepped ? state.moving[i] : static_cast<std::uint32_t>(i); };
  std::vector<std::uint32_t> moving;
  std::vector<Point> to;
  std::vector<Point> facing;
  bool any_facing = false;
  FitOutput out{};
  for (std::size_t g = 0; g < from.points.size(); ++g) {
    const Lanes* sums = &from.sums[g * channels];
    bool fitted = false;
    for (std::size_t i = g * kLanes; i < std::min(count, (g + 1) * kLanes); ++i) {
      const int l = static_cast<int>(i - g * kLanes);
      if (sums[kW][l] <= 0) continue;
      const Point here{from.points[g].x[l], from.points[g].y[l], from.points[g].z[l]};
      if (!state.stepped) {
        const Point n{sums[kNx][l], sums[kNy][l], sums[kNz][l]};
        const float w2 = sums[kW][l] * sums[kW][l];
        const float n2 = n.x * n.x + n.y * n.y + n.z * n.z;
        if (n2 > 0 && n2 < settings.sheets * settings.sheets * w2) {
          moving.push_back(number(i));
          to.push_back(here);
          facing.push_back(n);
          any_facing = true;
          continue;
        }
      }
      Point side{};
      if (!from.facing.empty()) side = {from.facing[g].x[l], from.facing[g].y[l], from.facing[g].z[l]};
      const bool behind = side.x != 0 || side.y != 0 || side.z != 0;
      if (pass >= settings.steps + (behind ? 1 : 0)) continue;
      if (!fitted) kernel.fit(sums, offsets(from, queries, g, count, settings.fit, shift, number), out);
      fitted = true;
      const float d = out.distance[l];
      if (d > kStepLimit || d < -kStepLimit) continue;
      const Point corner = point_of(queries[number(i)], shift);
      const Point p{corner.x - d * out.nx[l], corner.y - d * out.ny[l], corner.z - d * out.nz[l]};
      const Point by{p.x - here.x, p.y - here.y, p.z - here.z};
      const float still = std::max(kStill, settings.tolerance * sums[kWR][l] / sums[kW][l]);
      if (by.x * by.x + by.y * by.y + by.z * by.z <= still * still) continue;
      moving.push_back(number(i));
      to.push_back(p);
      facing.push_back(behind ? Point{out.nx[l], out.ny[l], out.nz[l]} : Point{});
      any_facing = any_facing || behind;
    }
  }
  settle(kernel, settings, state, queries, channels);
  state.moving = std::move(moving);
  if (state.moving.empty()) return false;
  state.sums += state.moving.size();
  fill(state.moved, to.size(), channels, [&](std::size_t i) { return to[i]; });
  if (any_facing) {
    state.moved.facing.resize(state.moved.points.size());
    for (std::size_t i = 0; i < state.moved.points.size() * kLanes; ++i) {
      const Point& f = facing[std::min(i, facing.size() - 1)];
      Queries& lanes = state.moved.facing[i / kLanes];
      const int l = static_cast<int>(i % kLanes);
      lanes.x[l] = f.x;
      lanes.y[l] = f.y;
      lanes.z[l] = f.z;
    }
  }
  state.stepped = true;
  return true;
}

void settle(const Kernel& kernel, const ProjectSettings& settings, TileState& state, const std::vector<Query>& queries,
            std::size_t channels) {
  const std::size_t count = state.stepped ? state.moving.size() : 0;
  const auto number = [&](std::size_t i) { return state.moving[i]; };
  FitOutput out{};
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t query = state.moving[i];
    const std::size_t to = query / kLanes;
    const int lane = static_cast<int>(query % kLanes);
    const std::size_t from = i / kLanes;
    const int l = static_cast<int>(i % kLanes);
    Lanes* const all = &state.all.sums[to * channels];
    const Lanes* const moved = &state.moved.sums[from * channels];
    if (!state.moved.facing.empty()) {
      if (l == 0)
        kernel.fit(moved, offsets(state.moved, queries, from, count, settings.fit, shift_of(settings), number), out);
      const Queries& f = state.moved.facing[from];
      if (f.x[l] != 0 || f.y[l] != 0 || f.z[l] != 0) {
        if (!is_apart(settings, all, lane, moved, l)) continue;
        if (out.offset_from_mean[l] > settings.trusted_offset ||
            moved[kSeen][l] < static_cast<float>(settings.trusted_samples))
          continue;
      }
    }
    state.all.points[to].x[lane] = state.moved.points[from].x[l];
    state.all.points[to].y[lane] = state.moved.points[from].y[l];
    state.all.points[to].z[lane] = state.moved.points[from].z[l];
    for (std::size_t c = 0; c < channels; ++c) all[c][lane] = moved[c][l];
  }
  state.stepped = false;
}

}  // namespace lamina
