#include "project/queries.h"

#include <algorithm>
#include <bit>

namespace lamina {
namespace {

std::size_t groups_of(const std::vector<Query>& queries) {
  return (queries.size() + kLanes - 1) / kLanes;
}

/// Query g * 8 + l; groups are filled up with copies of their last query.
const Query& query_of(const std::vector<Query>& queries, std::size_t group, int lane) {
  return queries[std::min(group * kLanes + static_cast<std::size_t>(lane), queries.size() - 1)];
}

void clear_sums(TileState& state, std::size_t groups, std::size_t channels) {
  state.sums.assign(groups * channels, Lanes{});
  for (std::size_t g = 0; g < groups; ++g) state.sums[g * channels + kNearest].v.fill(1e30F);
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
  const std::size_t groups = groups_of(queries);
  state.points.resize(groups);
  for (std::size_t g = 0; g < groups; ++g) {
    for (int l = 0; l < kLanes; ++l) {
      const Query& q = query_of(queries, g, l);
      state.points[g].x[l] = static_cast<float>(q.x) + shift;
      state.points[g].y[l] = static_cast<float>(q.y) + shift;
      state.points[g].z[l] = static_cast<float>(q.z) + shift;
    }
  }
  clear_sums(state, groups, channels);
}

void accumulate(const Kernel& kernel, const RowSamples& rows, TileState& state, std::size_t channels) {
  std::array<SampleRange, RowSamples::kRows> ranges{};
  for (std::size_t g = 0; g < state.points.size(); ++g) {
    const Queries& q = state.points[g];
    const auto [y_lo, y_hi] = std::minmax_element(q.y.v.begin(), q.y.v.end());
    const auto [z_lo, z_hi] = std::minmax_element(q.z.v.begin(), q.z.v.end());
    const int n = rows.ranges(*y_lo, *y_hi, *z_lo, *z_hi, ranges.data());
    kernel.accumulate(rows.samples(), ranges.data(), n, q, &state.sums[g * channels]);
  }
}

FitInput fit_input(const TileState& state, const std::vector<Query>& queries, std::size_t g, Fit fit, float shift) {
  FitInput in;
  in.sphere = fit == Fit::sphere;
  for (int l = 0; l < kLanes; ++l) {
    const Query& q = query_of(queries, g, l);
    in.offset.x[l] = static_cast<float>(q.x) + shift - state.points[g].x[l];
    in.offset.y[l] = static_cast<float>(q.y) + shift - state.points[g].y[l];
    in.offset.z[l] = static_cast<float>(q.z) + shift - state.points[g].z[l];
  }
  return in;
}

void advance(const Kernel& kernel, const ProjectSettings& settings, TileState& state, const std::vector<Query>& queries,
             std::size_t channels) {
  const float shift = shift_of(settings);
  FitOutput out{};
  for (std::size_t g = 0; g < state.points.size(); ++g) {
    kernel.fit(&state.sums[g * channels], fit_input(state, queries, g, settings.fit, shift), out);
    for (int l = 0; l < kLanes; ++l) {
      const Query& q = query_of(queries, g, l);
      const float d = out.distance[l];
      if (state.sums[g * channels + kW][l] <= 0 || d > kStepLimit || d < -kStepLimit) continue;
      state.points[g].x[l] = static_cast<float>(q.x) + shift - d * out.nx[l];
      state.points[g].y[l] = static_cast<float>(q.y) + shift - d * out.ny[l];
      state.points[g].z[l] = static_cast<float>(q.z) + shift - d * out.nz[l];
    }
  }
  clear_sums(state, state.points.size(), channels);
}

}  // namespace lamina
