#include "project/queries.h"

#include <algorithm>
#include <bit>

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
void fill(Lot& lot, std::size_t count, std::size_t channels, const At& at) {
  const std::size_t groups = (count + kLanes - 1) / kLanes;
  lot.points.resize(groups);
  for (std::size_t g = 0; g < groups; ++g) {
    for (int l = 0; l < kLanes; ++l) {
      const Point p = at(std::min(g * kLanes + static_cast<std::size_t>(l), count - 1));
      lot.points[g].x[l] = p.x;
      lot.points[g].y[l] = p.y;
      lot.points[g].z[l] = p.z;
    }
  }
  lot.sums.assign(groups * channels, Lanes{});
  for (std::size_t g = 0; g < groups; ++g) lot.sums[g * channels + kNearest].v.fill(1e30F);
}

/// From the points of a group to their corners; `number` tells the query of the lot's i-th point.
template <typename Number>
FitInput offsets(const Lot& lot, const std::vector<Query>& queries, std::size_t g, std::size_t count, Fit fit,
                 float shift, const Number& number) {
  FitInput in;
  in.sphere = fit == Fit::sphere;
  for (int l = 0; l < kLanes; ++l) {
    const std::size_t i = std::min(g * kLanes + static_cast<std::size_t>(l), count - 1);
    const Point corner = point_of(queries[number(i)], shift);
    in.offset.x[l] = corner.x - lot.points[g].x[l];
    in.offset.y[l] = corner.y - lot.points[g].y[l];
    in.offset.z[l] = corner.z - lot.points[g].z[l];
  }
  return in;
}

}  // namespace

void list_queries(const Work& work, std::vector<Query>& out) {
  out.clear();
  for (int z = work.begin; z < work.end; ++z) {
    const bool corners = work.points == work.tile.leaf;
    const std::uint64_t shared = corners ? work.tile.leaf->shared.words[z] : 0;
    for (std::uint64_t w = work.points->near.words[z]; w != 0; w &= w - 1) {
      const int bit = std::countr_zero(w);
      if (((shared >> bit) & 1U) != 0) continue;
      out.push_back(
          {static_cast<std::uint8_t>(bit & 7), static_cast<std::uint8_t>(bit >> 3), static_cast<std::uint8_t>(z)});
    }
  }
}

void start(TileState& state, const std::vector<Query>& queries, std::size_t channels, float shift) {
  fill(state.all, queries.size(), channels, [&](std::size_t i) { return point_of(queries[i], shift); });
  state.stepped = false;
}

void accumulate(const Kernel& kernel, const RowSamples& rows, TileState& state, std::size_t channels) {
  Lot& lot = state.stepped ? state.moved : state.all;
  std::array<SampleRange, RowSamples::kRows> ranges{};
  for (std::size_t g = 0; g < lot.points.size(); ++g) {
    const Queries& q = lot.points[g];
    const auto [y_lo, y_hi] = std::minmax_element(q.y.v.begin(), q.y.v.end());
    const auto [z_lo, z_hi] = std::minmax_element(q.z.v.begin(), q.z.v.end());
    const int n = rows.ranges(*y_lo, *y_hi, *z_lo, *z_hi, ranges.data());
    kernel.accumulate(rows.samples(), ranges.data(), n, q, &lot.sums[g * channels]);
  }
}

FitInput fit_input(const TileState& state, const std::vector<Query>& queries, std::size_t g, Fit fit, float shift) {
  return offsets(state.all, queries, g, queries.size(), fit, shift, [](std::size_t i) { return i; });
}

void advance(const Kernel& kernel, const ProjectSettings& settings, TileState& state, const std::vector<Query>& queries,
             std::size_t channels) {
  const float shift = shift_of(settings);
  const Lot& from = state.stepped ? state.moved : state.all;
  const std::size_t count = state.stepped ? state.moving.size() : queries.size();
  const auto number = [&](std::size_t i) { return state.stepped ? state.moving[i] : static_cast<std::uint32_t>(i); };
  std::vector<std::uint32_t> moving;
  std::vector<Point> to;
  FitOutput out{};
  for (std::size_t g = 0; g < from.points.size(); ++g) {
    const Lanes* sums = &from.sums[g * channels];
    kernel.fit(sums, offsets(from, queries, g, count, settings.fit, shift, number), out);
    for (std::size_t i = g * kLanes; i < std::min(count, (g + 1) * kLanes); ++i) {
      const int l = static_cast<int>(i - g * kLanes);
      const float d = out.distance[l];
      if (sums[kW][l] <= 0 || d > kStepLimit || d < -kStepLimit) continue;
      const Point corner = point_of(queries[number(i)], shift);
      const Point p{corner.x - d * out.nx[l], corner.y - d * out.ny[l], corner.z - d * out.nz[l]};
      const Point by{p.x - from.points[g].x[l], p.y - from.points[g].y[l], p.z - from.points[g].z[l]};
      if (by.x * by.x + by.y * by.y + by.z * by.z <= kStill * kStill) continue;
      moving.push_back(number(i));
      to.push_back(p);
    }
  }
  settle(state, channels);
  state.moving = std::move(moving);
  fill(state.moved, to.size(), channels, [&](std::size_t i) { return to[i]; });
  state.stepped = true;
}

void settle(TileState& state, std::size_t channels) {
  for (std::size_t i = 0; state.stepped && i < state.moving.size(); ++i) {
    const std::size_t to = state.moving[i] / kLanes;
    const int lane = static_cast<int>(state.moving[i] % kLanes);
    const std::size_t from = i / kLanes;
    const int l = static_cast<int>(i % kLanes);
    state.all.points[to].x[lane] = state.moved.points[from].x[l];
    state.all.points[to].y[lane] = state.moved.points[from].y[l];
    state.all.points[to].z[lane] = state.moved.points[from].z[l];
    for (std::size_t c = 0; c < channels; ++c) {
      state.all.sums[to * channels + c][lane] = state.moved.sums[from * channels + c][l];
    }
  }
  state.stepped = false;
}

}  // namespace lamina
