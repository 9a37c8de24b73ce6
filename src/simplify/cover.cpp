#include "simplify/cover.h"

#include <xmmintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr double kFar = std::numeric_limits<double>::infinity();
/// No less than x.
float float_above(double x) {
  constexpr float kUp = 1 + 2 * std::numeric_limits<float>::epsilon();
  return kUp * static_cast<float>(x) + std::numeric_limits<float>::min();
}

constexpr float kRoundedUp = 1.0001F;
constexpr double kTouching = 1e-9;   ///< of a side: a corner on its line is on no side of it
constexpr double kGoodEnough = 0.7;  ///< of the bound: no nearer facet is looked for

}  // namespace

Facet make_facet(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& origin) {
  Facet f;
  f.corners = {a, b, c};
  f.normal = unit(cross(b - a, c - a));
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 side = f.corners[(k + 1) % 3] - f.corners[k];
    f.length[k] = norm(side);
    f.along[k] = unit(side);
    f.outward[k] = cross(f.along[k], f.normal);
  }
  for (std::size_t plane = 0; plane < 4; ++plane) {
    const Vec3& across = plane == 0 ? f.normal : f.outward[plane - 1];
    const Vec3& through = plane == 0 ? a : f.corners[plane - 1];
    for (std::size_t axis = 0; axis < 3; ++axis) f.planes[axis][plane] = static_cast<float>(across[axis]);
    f.planes[3][plane] = -static_cast<float>(dot(across, through - origin));
  }
  return f;
}

bool Cover::prove(const std::array<Vec3, 3>& triangle, double error, std::span<const Facet* const> facets, int cuts) {
  facets_ = facets.first(std::min(facets.size(), kMostFacets));
  slack_ = bound_ - error;
  reach_ = kRoundedUp * static_cast<float>(slack_) + rounding_;
  good_ = static_cast<float>(kGoodEnough * slack_);
  error_ = 0;
  used_.clear();
  open_.clear();
  const Answer answer = ask_at_once(triangle);
  if (answer == Answer::far) return false;
  if (answer == Answer::open) open_.push_back({{0, 1, 2}, 3});
  while (!open_.empty()) {
    const Polygon polygon = open_.back();
    open_.pop_back();
    if (take(polygon)) continue;
    Cut cut{};
    bool found = false;
    for (std::size_t first = 0; first < polygon.size && !found; ++first) found = choose_cut(polygon, first, cut);
    if (!found) found = halve(polygon, cut);
    if (!found || cuts-- <= 0 || !split(polygon, cut)) return false;
  }
  error_ += error;
  return true;
}

/// All of it near one facet, as most triangles are? Else its corners are ready.
Cover::Answer Cover::ask_at_once(const std::array<Vec3, 3>& triangle) {
  if (corners_.size() < 3) corners_.resize(3);
  held_ = 3;
  for (std::size_t k = 0; k < 3; ++k) {
    corners_[k].at = triangle[k];
    corners_[k].local = to_float(triangle[k] - origin_);
    corners_[k].near = 0;
  }
  for (std::size_t f = 0; f < facets_.size(); ++f) {
    const std::uint64_t bit = std::uint64_t{1} << f;
    for (std::size_t k = 0; k < 3; ++k) ask(f, corners_[k]);
    if ((corners_[0].near & corners_[1].near & corners_[2].near & bit) == 0) continue;
    const float most = std::max({corners_[0].distance[f], corners_[1].distance[f], corners_[2].distance[f]});
    if (most > good_) continue;
    use(f, most);
    return Answer::near;
  }
  const bool all = corners_[0].near != 0 && corners_[1].near != 0 && corners_[2].near != 0;
  return all ? Answer::open : Answer::far;
}

/// Is the corner near the facet? Floats tell of most that they are too far away, or that they face each other. It does
/// no harm that they may take a facet for too far that is only just within reach.
void Cover::ask(std::size_t facet, Corner& corner) const {
  const Facet& f = *facets_[facet];
  const auto times = [&](std::size_t axis) {
    return _mm_mul_ps(_mm_load_ps(f.planes[axis].data()), _mm_set1_ps(corner.local[axis]));
  };
  const __m128 beyond =
      _mm_add_ps(_mm_add_ps(times(0), times(1)), _mm_add_ps(times(2), _mm_load_ps(f.planes[3].data())));
  if (_mm_movemask_ps(_mm_cmpgt_ps(beyond, _mm_set1_ps(reach_))) != 0) return;
  alignas(16) std::array<float, 4> out;
  _mm_store_ps(out.data(), beyond);
  const float height = std::abs(out[0]);
  if (height > reach_) return;
  // Beyond one side at most, and farther inside of the others: its foot is on the facet.
  const float most = std::max({out[1], out[2], out[3]}), least = std::min({out[1], out[2], out[3]});
  const float between = std::max(std::min(out[1], out[2]), std::min(std::max(out[1], out[2]), out[3]));
  const float side = std::max(most, 0.0F) + rounding_;
  if (least <= -side && between <= -side) {
    const float surely = std::sqrt(height * height + side * side) + rounding_ + static_cast<float>(f.error);
    if (surely < good_) {
      corner.near |= std::uint64_t{1} << facet;
      corner.distance[facet] = kRoundedUp * surely;
      return;
    }
  }
  const double d = distance_within(corner.at, f, slack_ - f.error);
  if (d == kFar) return;
  corner.near |= std::uint64_t{1} << facet;
  corner.distance[facet] = float_above(d + f.error);
}

/// Between two others. False where it is near no facet. What both are near, so is it.
bool Cover::add_corner(std::size_t from, std::size_t to, double share) {
  if (held_ == corners_.size()) corners_.resize(2 * held_);
  const Corner &a = corners_[from], &b = corners_[to];
  Corner& corner = corners_[held_++];
  corner.at = a.at + share * (b.at - a.at);
  corner.local = to_float(corner.at - origin_);
  corner.near = a.near & b.near;
  for (std::uint64_t left = corner.near; left != 0; left &= left - 1) {
    const auto f = static_cast<std::size_t>(std::countr_zero(left));
    corner.distance[f] = std::max(a.distance[f], b.distance[f]);
  }
  for (std::size_t f = 0; f < facets_.size(); ++f) {
    if ((corner.near >> f & 1U) == 0) ask(f, corner);
  }
  return corner.near != 0;
}

void Cover::use(std::size_t facet, float error) {
  error_ = std::max(error_, static_cast<double>(error));
  const std::uint32_t id = facets_[facet]->id;
  if (std::find(used_.begin(), used_.end(), id) == used_.end()) used_.push_back(id);
}

/// Is all of it near one facet? The one that is nearest, or near enough.
bool Cover::take(const Polygon& polygon) {
  std::uint64_t near = ~std::uint64_t{0};
  for (std::size_t i = 0; i < polygon.size; ++i) near &= corners_[polygon.corners[i]].near;
  if (near == 0) return false;
  std::size_t best = 0;
  float least = std::numeric_limits<float>::infinity();
  for (; near != 0 && least > good_; near &= near - 1) {
    const auto f = static_cast<std::size_t>(std::countr_zero(near));
    float error = 0;
    for (std::size_t i = 0; i < polygon.size; ++i) error = std::max(error, corners_[polygon.corners[i]].distance[f]);
    if (error >= least) continue;
    best = f;
    least = error;
  }
  use(best, least);
  return true;
}

/// Along the side of a facet that is near the first corner, between that and one that it is not near.
bool Cover::choose_cut(const Polygon& polygon, std::size_t first, Cut& cut) const {
  const auto corner = [&](std::size_t i) -> const Corner& {
    return corners_[polygon.corners[(first + i) % polygon.size]];
  };
  std::size_t most_near = 0;
  for (std::uint64_t left = corner(0).near; left != 0; left &= left - 1) {
    const auto number = static_cast<std::size_t>(std::countr_zero(left));
    std::size_t near = 1, far = 0;
    for (std::size_t i = 1; i < polygon.size; ++i) {
      const bool is_near = (corner(i).near >> number & 1U) != 0;
      near += is_near ? 1 : 0;
      if (!is_near && far == 0) far = i;
    }
    if (near <= most_near || far == 0) continue;
    const Facet& f = *facets_[number];
    double farthest = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double touching = kTouching * f.length[k];
      const double beyond = dot(f.outward[k], corner(far).at - f.corners[k]);
      if (beyond <= std::max(farthest, touching) || dot(f.outward[k], corner(0).at - f.corners[k]) > -touching)
        continue;
      farthest = beyond;
      cut = {f.outward[k], dot(f.outward[k], f.corners[k])};
      most_near = near;
    }
  }
  return most_near > 0;
}

/// Across the longest side, where none of the facets' sides will do.
bool Cover::halve(const Polygon& polygon, Cut& cut) const {
  double longest2 = 0;
  for (std::size_t i = 0; i < polygon.size; ++i) {
    const Vec3 &a = corners_[polygon.corners[i]].at, &b = corners_[polygon.corners[(i + 1) % polygon.size]].at;
    const Vec3 side = b - a;
    if (dot(side, side) <= longest2) continue;
    longest2 = dot(side, side);
    cut = {side, 0.5 * dot(side, a + b)};
  }
  return longest2 > 0;
}

bool Cover::split(const Polygon& polygon, const Cut& cut) {
  Polygon below, above;
  const auto add = [](Polygon& p, std::size_t corner) {
    if (p.size < kMostCorners) p.corners[p.size] = static_cast<std::uint16_t>(corner);
    ++p.size;
  };
  std::array<double, kMostCorners> height{};
  for (std::size_t i = 0; i < polygon.size; ++i)
    height[i] = dot(cut.normal, corners_[polygon.corners[i]].at) - cut.offset;
  for (std::size_t i = 0; i < polygon.size; ++i) {
    const std::size_t next = i + 1 == polygon.size ? 0 : i + 1;
    const double dx = height[i], dy = height[next];
    if (dx <= 0) add(below, polygon.corners[i]);
    if (dx >= 0) add(above, polygon.corners[i]);
    if ((dx < 0 && dy > 0) || (dx > 0 && dy < 0)) {
      const std::size_t from = polygon.corners[i], to = polygon.corners[next];
      if (held_ > std::numeric_limits<std::uint16_t>::max() || !add_corner(from, to, dx / (dx - dy))) return false;
      add(below, held_ - 1);
      add(above, held_ - 1);
    }
  }
  if (below.size > kMostCorners || above.size > kMostCorners) return false;
  if (below.size == polygon.size && above.size < 3) return false;
  if (above.size == polygon.size && below.size < 3) return false;
  if (below.size >= 3) open_.push_back(below);
  if (above.size >= 3) open_.push_back(above);
  return true;
}

}  // namespace lamina::simplify
