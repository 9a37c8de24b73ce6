#include "mls/queries.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "base/four.h"

namespace lamina {
namespace {

struct Point {
  float x, y, z;
  [[nodiscard]] bool is_zero() const { return x == 0 && y == 0 && z == 0; }
};

/// The corner (or centre) of a query.
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

/// The corners of a group's points; `corner` tells that of the batch's i-th point, of so many.
template <typename Corner>
Queries corners_of(std::size_t g, std::size_t count, const Corner& corner) {
  Queries out{};
  for (int l = 0; l < kLanes; ++l) {
    const Point at = corner(std::min(g * kLanes + static_cast<std::size_t>(l), count - 1));
    out.x[l] = at.x;
    out.y[l] = at.y;
    out.z[l] = at.z;
  }
  return out;
}

/// From the points of a group to their corners.
FitInput offsets(const ProjectRule& rule, const Queries& from, const Queries& to) {
  FitInput in;
  in.sphere = rule.settings.fit == Fit::sphere;
  for (int l = 0; l < kLanes; ++l) {
    in.offset.x[l] = to.x[l] - from.x[l];
    in.offset.y[l] = to.y[l] - from.y[l];
    in.offset.z[l] = to.z[l] - from.z[l];
  }
  return in;
}

/// Where a step takes a group's points.
struct Step {
  Queries to;
  unsigned moves = 0;  ///< a bit for each point that it moves noticeably, and whose surface is near enough for steps
};

/// Of all eight at once, without branches: which of them move is as good as random.
Step step_of(const FitOutput& fit, const Queries& from, const Queries& corners, const Lanes* sums, float tolerance) {
  Step out{};
  for (int l = 0; l < kLanes; ++l) {
    const float d = fit.distance[l];
    const Point p{corners.x[l] - d * fit.nx[l], corners.y[l] - d * fit.ny[l], corners.z[l] - d * fit.nz[l]};
    const Point by{p.x - from.x[l], p.y - from.y[l], p.z - from.z[l]};
    const float still = std::max(kStill, tolerance * sums[kWR][l] / sums[kW][l]);
    const bool stays = by.x * by.x + by.y * by.y + by.z * by.z <= still * still;
    out.to.x[l] = p.x;
    out.to.y[l] = p.y;
    out.to.z[l] = p.z;
    out.moves |= static_cast<unsigned>(!((d > kStepLimit) | (d < -kStepLimit) | stays)) << l;
  }
  return out;
}

/// For each set of the corners of a square, x first, their places as queries from its low corner on, one after the
/// other; behind them anything.
constexpr std::array<std::array<std::uint32_t, 4>, 16> list_squares() {
  std::array<std::array<std::uint32_t, 4>, 16> out{};
  for (unsigned set = 0; set < out.size(); ++set) {
    std::size_t n = 0;
    for (std::uint32_t corner = 0; corner < 4; ++corner) {
      if (((set >> corner) & 1U) != 0) out[set][n++] = (corner & 1) | (corner >> 1) << 8;
    }
  }
  return out;
}
constexpr std::array<std::array<std::uint32_t, 4>, 16> kListedSquares = list_squares();

}  // namespace

void list_queries(const Work& work, std::vector<Query>& out) {
  const auto [begin, end] = work.layers;
  const auto wanted = [&, begin = begin, end = end](int z) {
    if (z < begin || z >= end) return std::uint64_t{0};
    return work.own(z);
  };
  std::array<Query, 512 + 3> list;  // NOLINT(cppcoreguidelines-pro-type-member-init): filled next
  std::size_t n = 0;
  for (int z = begin & ~1; z < end; z += 2) {
    const std::array<std::uint64_t, 2> layers{wanted(z), wanted(z + 1)};
    for (int y = 0; y < 8; y += 2) {
      if ((((layers[0] | layers[1]) >> (8 * y)) & 0xFFFF) == 0) continue;
      for (int i = 0; i < 8; i += 2) {
        // To and fro: what follows lies beside.
        const int x = (y & 2) == 0 ? i : 6 - i;
        for (int k = 0; k < 2; ++k) {
          const std::uint64_t rows = layers[static_cast<std::size_t>(k)] >> (x + 8 * y);
          const std::size_t square = (rows & 3) | (rows >> 6 & 12);
          // All four are written, what is not wanted is written over: which are is as good as random.
          const FourInts four = load_four(kListedSquares[square].data()) + four_times(x | y << 8 | (z + k) << 16);
          std::memcpy(&list[n], &four, sizeof(four));
          n += static_cast<std::size_t>(std::popcount(square));
        }
      }
    }
  }
  out.assign(list.data(), list.data() + n);
}

void TileSteps::start() {
  fill(state_.all, queries_.size(), rule_.channels,
       [&](std::size_t i) { return point_of(queries_[i], rule_.shift()); });
  state_.stepped = false;
  state_.sums = queries_.size();
}

void TileSteps::accumulate(const RowSamples& rows) {
  QueryBatch& batch = state_.stepped ? state_.moved : state_.all;
  std::array<SampleRange, RowSamples::kRows> ranges{};
  for (std::size_t g = 0; g < batch.points.size(); ++g) {
    const Queries& q = batch.points[g];
    const auto [y_lo, y_hi] = extremes_of(q.y);
    const auto [z_lo, z_hi] = extremes_of(q.z);
    const int n = rows.ranges(y_lo, y_hi, z_lo, z_hi, ranges.data());
    Lanes* const sums = &batch.sums[g * rule_.channels];
    if (batch.facing.empty()) {
      rule_.kernel.accumulate(rows.samples(), ranges.data(), n, q, sums);
    } else {
      rule_.kernel.accumulate_facing(rows.samples(), ranges.data(), n, q, batch.facing[g], sums);
    }
  }
}

/// The points of the next pass.
struct TileSteps::Next {
  std::vector<std::uint32_t> moving;
  std::vector<Point> to;
  std::vector<Point> facing;
  bool any_facing = false;
  FitOutput fit{};  ///< of the group at hand

  explicit Next(std::size_t most) : most_(most) {}
  void add(std::uint32_t query, const Point& point, const Point& side) {
    if (moving.empty()) reserve();
    moving.push_back(query);
    to.push_back(point);
    facing.push_back(side);
    any_facing = any_facing || !side.is_zero();
  }

 private:
  /// Only where a point goes on: in most tiles none does.
  void reserve() {
    moving.reserve(most_);
    to.reserve(most_);
    facing.reserve(most_);
  }

  std::size_t most_;
};

/// Whether the samples' mean normal is so short that they face several ways.
bool TileSteps::sees_two_sheets(const Lanes* sums, int l) const {
  const float w2 = sums[kW][l] * sums[kW][l];
  const float x = sums[kNx][l];
  const float y = sums[kNy][l];
  const float z = sums[kNz][l];
  const float n2 = x * x + y * y + z * z;
  return n2 > 0 && n2 < rule_.settings.sheets * rule_.settings.sheets * w2;
}

bool TileSteps::any_sees_two_sheets(const Lanes* sums) const {
  bool any = false;
  for (int l = 0; l < kLanes; ++l) any |= sees_two_sheets(sums, l);
  return any;
}

/// Finds those of a group's points that go on, and where.
void TileSteps::advance_group(std::size_t g, std::size_t count, int pass, Next& next) const {
  FitOutput& fit = next.fit;
  const QueryBatch& from = state_.stepped ? state_.moved : state_.all;
  const Lanes* const sums = &from.sums[g * rule_.channels];
  // Most groups, where one step is all.
  if (!state_.stepped && pass >= rule_.settings.steps && !any_sees_two_sheets(sums)) return;
  Step step{};
  bool stepped = false;
  for (std::size_t i = g * kLanes; i < std::min(count, (g + 1) * kLanes); ++i) {
    const int l = static_cast<int>(i - g * kLanes);
    if (sums[kW][l] <= 0) continue;
    if (!state_.stepped && sees_two_sheets(sums, l)) {
      const Point here{from.points[g].x[l], from.points[g].y[l], from.points[g].z[l]};
      next.add(query_of(i), here, {sums[kNx][l], sums[kNy][l], sums[kNz][l]});
      continue;
    }
    Point side{};
    if (!from.facing.empty()) side = {from.facing[g].x[l], from.facing[g].y[l], from.facing[g].z[l]};
    const bool behind = !side.is_zero();
    if (pass >= rule_.settings.steps + (behind ? 1 : 0)) continue;
    if (!stepped) {
      const Queries corners =
          corners_of(g, count, [&](std::size_t k) { return point_of(queries_[query_of(k)], rule_.shift()); });
      rule_.kernel.fit(sums, offsets(rule_, from.points[g], corners), fit);
      step = step_of(fit, from.points[g], corners, sums, rule_.settings.tolerance);
      stepped = true;
    }
    if (((step.moves >> l) & 1U) == 0) continue;
    next.add(query_of(i), {step.to.x[l], step.to.y[l], step.to.z[l]},
             behind ? Point{fit.nx[l], fit.ny[l], fit.nz[l]} : Point{});
  }
}

bool TileSteps::advance(int pass) {
  const std::size_t count = state_.stepped ? state_.moving.size() : queries_.size();
  Next next(count);
  for (std::size_t g = 0; g * kLanes < count; ++g) advance_group(g, count, pass, next);
  settle();
  state_.moving.assign(next.moving.begin(), next.moving.end());
  if (state_.moving.empty()) return false;
  state_.sums += state_.moving.size();
  fill(state_.moved, next.to.size(), rule_.channels, [&](std::size_t i) { return next.to[i]; });
  if (next.any_facing) {
    state_.moved.facing.resize(state_.moved.points.size());
    for (std::size_t i = 0; i < state_.moved.points.size() * kLanes; ++i) {
      const Point& f = next.facing[std::min(i, next.facing.size() - 1)];
      Queries& lanes = state_.moved.facing[i / kLanes];
      const int l = static_cast<int>(i % kLanes);
      lanes.x[l] = f.x;
      lanes.y[l] = f.y;
      lanes.z[l] = f.z;
    }
  }
  state_.stepped = true;
  return true;
}

/// Whether the samples a point sees lie on two sheets, facing opposite ways, that the lattice can tell apart.
bool TileSteps::is_apart(const Lanes* all, int lane, const Lanes* own_side, int l) const {
  const float w_own = own_side[kW][l];
  const float w_other = all[kW][lane] - w_own;
  if (w_own <= 0 || w_other <= 0) return false;
  float apart = 0;
  float n2 = 0;
  float against = 0;
  float other2 = 0;
  for (int k = 0; k < 3; ++k) {
    const float n = own_side[kNx + k][l];
    const float other = all[kNx + k][lane] - n;
    apart += n * ((all[kPx + k][lane] - own_side[kPx + k][l]) / w_other - own_side[kPx + k][l] / w_own);
    n2 += n * n;
    against += n * other;
    other2 += other * other;
  }
  const float n = std::sqrt(n2);
  return std::abs(apart) >= rule_.settings.apart * n && against < kOpposed * n * std::sqrt(other2);
}

void TileSteps::settle() {
  const std::size_t count = state_.stepped ? state_.moving.size() : 0;
  const ProjectSettings& settings = rule_.settings;
  const auto corner_of = [&](std::size_t k) { return point_of(queries_[state_.moving[k]], rule_.shift()); };
  FitOutput fit{};
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t query = state_.moving[i];
    const std::size_t to = query / kLanes;
    const int lane = static_cast<int>(query % kLanes);
    const std::size_t from = i / kLanes;
    const int l = static_cast<int>(i % kLanes);
    Lanes* const all = &state_.all.sums[to * rule_.channels];
    const Lanes* const moved = &state_.moved.sums[from * rule_.channels];
    if (!state_.moved.facing.empty()) {
      if (l == 0)
        rule_.kernel.fit(moved, offsets(rule_, state_.moved.points[from], corners_of(from, count, corner_of)), fit);
      const Queries& f = state_.moved.facing[from];
      if (f.x[l] != 0 || f.y[l] != 0 || f.z[l] != 0) {
        if (!is_apart(all, lane, moved, l)) continue;
        if (fit.offset_from_mean[l] > settings.trusted_offset ||
            moved[kSeen][l] < static_cast<float>(settings.trusted_samples))
          continue;
      }
    }
    state_.all.points[to].x[lane] = state_.moved.points[from].x[l];
    state_.all.points[to].y[lane] = state_.moved.points[from].y[l];
    state_.all.points[to].z[lane] = state_.moved.points[from].z[l];
    for (std::size_t c = 0; c < rule_.channels; ++c) all[c][lane] = moved[c][l];
  }
  state_.stepped = false;
}

FitInput fit_input(const ProjectRule& rule, const TileState& state, const std::vector<Query>& queries,
                   std::size_t group) {
  const auto corner_of = [&](std::size_t i) { return point_of(queries[i], rule.shift()); };
  return offsets(rule, state.all.points[group], corners_of(group, queries.size(), corner_of));
}

}  // namespace lamina
