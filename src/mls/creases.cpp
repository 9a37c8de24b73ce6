#include "mls/creases.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace lamina {
namespace {

using meshes::Vec3;
using meshes::operator-;
using meshes::operator*;
using meshes::dot;
using meshes::unit;

/// Samples farther away than this (cells, on average) make no surface near the corner.
constexpr double kFarMean = 2;

/// A vector of three sums beginning at `first`.
Vec3 sums_of(const Lanes* sums, int first, int l) {
  return {sums[first][l], sums[first + 1][l], sums[first + 2][l]};
}

/// The direction in which normals vary most: the dominant eigenvector of their covariance, by squaring it.
Vec3 principal(const std::array<double, 6>& moments, const Vec3& mean) {
  using Matrix = std::array<Vec3, 3>;
  const auto& [xx, xy, xz, yy, yz, zz] = moments;
  Matrix c{Vec3{xx, xy, xz}, Vec3{xy, yy, yz}, Vec3{xz, yz, zz}};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) c[i][k] -= mean[i] * mean[k];
  }
  constexpr int kSquarings = 6;  // eigenvalues of 1 : 2 become 1 : 2^64
  for (int n = 0; n < kSquarings; ++n) {
    const double trace = c[0][0] + c[1][1] + c[2][2];
    if (!(trace > 1e-12)) return {};
    for (Vec3& row : c) row = (1 / trace) * row;
    Matrix squared;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t k = 0; k < 3; ++k) squared[i][k] = dot(c[i], c[k]);  // it is symmetric
    }
    c = squared;
  }
  return unit(
      *std::max_element(c.begin(), c.end(), [](const Vec3& a, const Vec3& b) { return dot(a, a) < dot(b, b); }));
}

void put(Queries& to, int l, const std::array<float, 3>& v) {
  to.x[l] = v[0];
  to.y[l] = v[1];
  to.z[l] = v[2];
}

void put(NormalRegion& to, int l, const CreaseState::Region& r) {
  put(to.first, l, r.first);
  put(to.second, l, r.second);
  to.first_least[l] = r.first_least;
  to.second_least[l] = r.second_least;
}

std::size_t groups_of(std::size_t points) {
  return (points + kLanes - 1) / kLanes;
}

}  // namespace

/// Of a group's points, a bit each, those whose normals vary: told for all at once, a little too often.
unsigned CreaseFinder::varying(std::size_t group) const {
  constexpr auto kLongest = static_cast<float>(1 - 0.98 * kLeastVariance);
  const Lanes* const sums = &tile_.all.sums[group * rule_.channels];
  std::array<unsigned, kLanes> bits{};
  for (int l = 0; l < kLanes; ++l) {
    const float x = sums[kNx][l];
    const float y = sums[kNy][l];
    const float z = sums[kNz][l];
    const float w = sums[kW][l];
    bits[static_cast<std::size_t>(l)] = x * x + y * y + z * z > kLongest * w * w ? 0U : 1U << l;
  }
  unsigned all = 0;
  for (const unsigned bit : bits) all |= bit;
  return all;
}

bool CreaseFinder::may_crease(std::uint32_t query, Vec3& mean) const {
  const Lanes* const sums = &tile_.all.sums[query / kLanes * rule_.channels];
  const int l = static_cast<int>(query % kLanes);
  const double w = sums[kW][l];
  if (!(w > 0) || sums[kNearest][l] > 1) return false;
  mean = (1 / w) * sums_of(sums, kNx, l);
  if (1 - dot(mean, mean) < kLeastVariance) return false;
  const Vec3 at = (1 / w) * sums_of(sums, kPx, l);
  return dot(at, at) < kFarMean * kFarMean;
}

bool CreaseFinder::start() {
  state_.points.clear();
  state_.found.clear();
  const auto count = static_cast<std::uint32_t>(queries_.size());
  for (std::uint32_t first = 0; first < count; first += kLanes) {
    for (unsigned bits = varying(first / kLanes); bits != 0; bits &= bits - 1) {
      CreaseState::Point p;
      p.query = first + static_cast<std::uint32_t>(std::countr_zero(bits));
      if (p.query < count && may_crease(p.query, p.loose_mean)) state_.points.push_back(p);
    }
  }
  if (state_.points.empty()) return false;
  begin_splitting();
  return true;
}

void CreaseFinder::begin_splitting() {
  const std::size_t groups = groups_of(state_.points.size());
  state_.splitting = true;
  state_.at.resize(groups);
  state_.regions[0].resize(groups);
  state_.moments.assign(groups * (kMoments + 1), Lanes{});
  for (std::size_t i = 0; i < groups * kLanes; ++i) {
    const CreaseState::Point& p = state_.points[std::min(i, state_.points.size() - 1)];
    const int l = static_cast<int>(i % kLanes);
    const Queries& from = tile_.all.points[p.query / kLanes];
    const int lane = static_cast<int>(p.query % kLanes);
    put(state_.at[i / kLanes], l, {from.x[lane], from.y[lane], from.z[lane]});
    put(state_.regions[0][i / kLanes], l, p.regions[p.loose]);
  }
}

void CreaseFinder::begin_sheets() {
  const std::size_t groups = groups_of(state_.points.size());
  state_.splitting = false;
  const std::size_t sheets = state_.points.front().sheets;
  for (std::size_t k = 0; k < sheets; ++k) {
    state_.regions[k].resize(groups);
    state_.sums[k].assign(groups * kSheetSums, Lanes{});
    for (std::size_t i = 0; i < groups * kLanes; ++i) {
      put(state_.regions[k][i / kLanes], static_cast<int>(i % kLanes),
          state_.points[std::min(i, state_.points.size() - 1)].regions[k]);
    }
  }
}

void CreaseFinder::accumulate(const RowSamples& rows) {
  std::array<SampleRange, RowSamples::kRows> ranges{};
  for (std::size_t g = 0; g < state_.at.size(); ++g) {
    const Queries& q = state_.at[g];
    const auto [y_lo, y_hi] = extremes_of(q.y);
    const auto [z_lo, z_hi] = extremes_of(q.z);
    const int n = rows.ranges(y_lo, y_hi, z_lo, z_hi, ranges.data());
    if (state_.splitting) {
      rule_.kernel.accumulate_moments(rows.samples(), ranges.data(), n, q, state_.regions[0][g],
                                      &state_.moments[g * (kMoments + 1)]);
      continue;
    }
    for (std::size_t k = 0; k < state_.points.front().sheets; ++k) {
      rule_.kernel.accumulate_sheet(rows.samples(), ranges.data(), n, q, state_.regions[k][g],
                                    &state_.sums[k][g * kSheetSums]);
    }
  }
}

bool CreaseFinder::advance() {
  if (state_.splitting) {
    split();
    if (!state_.points.empty()) begin_sheets();
  } else {
    judge();
    if (!state_.points.empty()) begin_splitting();
  }
  return !state_.points.empty();
}

/// Splits the loose sheet of every point across the direction in which its normals vary most.
void CreaseFinder::split() {
  for (std::size_t i = 0; i < state_.points.size(); ++i) {
    CreaseState::Point& p = state_.points[i];
    const Lanes* const sums = &state_.moments[i / kLanes * (kMoments + 1)];
    const int l = static_cast<int>(i % kLanes);
    const double w = sums[kMoments][l];
    std::array<double, 6> moments{};
    for (int k = 0; k < kMoments; ++k) moments[static_cast<std::size_t>(k)] = sums[k][l] / w;
    const Vec3 axis = principal(moments, p.loose_mean);
    const auto least = static_cast<float>(dot(axis, p.loose_mean));
    const std::array<float, 3> up = meshes::to_float(axis);
    const std::array<float, 3> down{-up[0], -up[1], -up[2]};
    CreaseState::Region& low = p.regions[p.loose];
    CreaseState::Region& high = p.regions[p.sheets];
    high = low;
    if (p.sheets == 1) {
      low.first = down;
      low.first_least = -least;
      high.first = up;
      high.first_least = least;
    } else {
      low.second = down;
      low.second_least = -least;
      high.second = up;
      high.second_least = least;
    }
    ++p.sheets;
  }
}

FitInput CreaseFinder::offsets(std::size_t group) const {
  FitInput in;
  in.sphere = rule_.settings.fit == Fit::sphere;
  for (int l = 0; l < kLanes; ++l) {
    const std::size_t i = std::min(group * kLanes + static_cast<std::size_t>(l), state_.points.size() - 1);
    const Query& q = queries_[state_.points[i].query];
    in.offset.x[l] = static_cast<float>(q.x) - state_.at[group].x[l];
    in.offset.y[l] = static_cast<float>(q.y) - state_.at[group].y[l];
    in.offset.z[l] = static_cast<float>(q.z) - state_.at[group].z[l];
  }
  return in;
}

std::size_t CreaseFinder::fit_sheets(std::size_t point, const std::array<FitOutput, 3>& fits, std::array<Sheet, 3>& out,
                                     double& support) const {
  const std::size_t g = point / kLanes;
  const int l = static_cast<int>(point % kLanes);
  const Queries& at = state_.at[g];
  const Query& q = queries_[state_.points[point].query];
  const Vec3 corner{q.x - double{at.x[l]}, q.y - double{at.y[l]}, q.z - double{at.z[l]}};
  std::size_t count = 0;
  double total = 0;
  double radii = 0;
  for (std::size_t k = 0; k < state_.points[point].sheets; ++k) {
    const Lanes* const sums = &state_.sums[k][g * kSheetSums];
    const double w = sums[kW][l];
    if (!(w > 0)) continue;  // no samples: the others' sheets go on
    const double sheet_support = sums[kWR][l] / w;
    const double lift = sums[kPN][l] / w;
    if (sums[kThickness][l] / w - lift * lift > kMostThickness * kMostThickness * sheet_support * sheet_support)
      return 0;
    const Vec3 normal{fits[k].nx[l], fits[k].ny[l], fits[k].nz[l]};
    if (dot(normal, normal) < 0.5) return 0;
    Sheet& sheet = out[count++];
    sheet.normal = unit(normal);
    sheet.point = -double{fits[k].distance[l]} * sheet.normal;
    sheet.curvature = fits[k].curvature[l];
    sheet.mean = (1 / w) * sums_of(sums, kPx, l) - corner;
    sheet.share = w;
    total += w;
    radii += sums[kWR][l];
  }
  for (std::size_t k = 0; k < count; ++k) out[k].share /= total;
  if (count > 0) support = radii / total;
  for (std::size_t j = 0; j < count; ++j) {
    for (std::size_t k = j + 1; k < count; ++k) {
      const double cosine = dot(out[j].normal, out[k].normal);
      if (cosine > kLeastBend || (count == 2 && cosine < double{kOpposed})) return 0;
    }
  }
  return count;
}

/// Points whose sheets are tight are done; those with one that is not have it split once more.
void CreaseFinder::judge() {
  std::vector<CreaseState::Point> next;
  std::array<FitOutput, 3> fits{};
  for (std::size_t i = 0; i < state_.points.size(); ++i) {
    CreaseState::Point& p = state_.points[i];
    const std::size_t g = i / kLanes;
    const int l = static_cast<int>(i % kLanes);
    if (l == 0) {
      const FitInput in = offsets(g);
      for (std::size_t k = 0; k < p.sheets; ++k) rule_.kernel.fit(&state_.sums[k][g * kSheetSums], in, fits[k]);
    }
    double total = 0;
    Vec3 sum{};
    std::array<double, 3> within{};
    for (std::size_t k = 0; k < p.sheets; ++k) {
      const Lanes* const sums = &state_.sums[k][g * kSheetSums];
      const double w = sums[kW][l];
      const Vec3 n = sums_of(sums, kNx, l);
      total += w;
      sum = meshes::operator+(sum, n);
      within[k] = w > 0 ? w - dot(n, n) / w : 0;
    }
    if (!(total > 0)) continue;
    const double variance = total - dot(sum, sum) / total;
    const double kept = within[0] + within[1] + within[2];
    if (kept <= kMostWithin * variance) {
      std::array<Sheet, 3> sheets;
      Crease found;
      found.query = p.query;
      const std::size_t count = fit_sheets(i, fits, sheets, found.support);
      if (count > 0 && combine_sheets(sheets, count, found.value)) state_.found.push_back(found);
      continue;
    }
    if (p.sheets == 3) continue;
    p.loose = within[1] > within[0] ? 1 : 0;
    if (within[1 - p.loose] > kMostWithin * variance) continue;
    const Lanes* const sums = &state_.sums[p.loose][g * kSheetSums];
    p.loose_mean = (1 / double{sums[kW][l]}) * sums_of(sums, kNx, l);
    next.push_back(p);
  }
  state_.points = std::move(next);
}

}  // namespace lamina
