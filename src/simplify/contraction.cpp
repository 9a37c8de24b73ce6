#include "simplify/contraction.h"

#include <algorithm>
#include <cstddef>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr float kLeastCosine = 0.2F;  ///< a triangle turns no farther at one contraction

using Lanes = Moves::Lanes;
using Triple = Moves::Triple;

Triple less(const Triple& a, const Triple& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Lanes times(const Triple& a, const Triple& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Triple across(const Triple& a, const Triple& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

}  // namespace

Placed place_edge(const Quadric& sum, const Vec3& a, const Vec3& b) {
  const Vec3 middle = 0.5 * (a + b), edge = b - a;
  if (const auto least = sum.least()) {
    const Vec3 off = *least - middle;
    if (dot(off, off) < 4 * dot(edge, edge)) return {*least, std::max(0.0, sum.at(*least))};
  }
  const double at_a = sum.at(a), at_b = sum.at(b), at_middle = sum.at(middle);
  if (at_middle <= at_a && at_middle <= at_b) return {middle, std::max(0.0, at_middle)};
  return at_a <= at_b ? Placed{a, std::max(0.0, at_a)} : Placed{b, std::max(0.0, at_b)};
}

Moves::Moves(const Vec3& to, const Vec3& a, const Vec3& b, double sliver)
    : to_(to), scale_(1), sliver2_(static_cast<float>(sliver * sliver)) {
  const double length = norm(b - a);
  if (length > 0) scale_ = 1 / length;
}

/// A triangle's quality goes by four times its squared area over the square of the sum of its squared sides: 1/12 where
/// it is equilateral, 0 where it has no area.
bool Moves::keep() {
  size_ = 0;
  const auto& [from, p, q] = corners_;
  const Triple from_p = less(p, from), from_q = less(q, from), base = less(q, p);
  const Triple before = across(from_p, from_q), after = across(p, q);
  const Lanes along = times(before, after), was = times(before, before), is = times(after, after);
  const Lanes side = times(base, base);
  const Lanes was_sides = times(from_p, from_p) + times(from_q, from_q) + side;
  const Lanes is_sides = times(p, p) + times(q, q) + side;
  const auto same_side = (along > 0) & (along * along > kLeastCosine * kLeastCosine * was * is);
  const auto good = 12 * is >= sliver2_ * is_sides * is_sides;
  const auto no_worse = is * was_sides * was_sides >= was * is_sides * is_sides;
  const auto kept = same_side & (good | no_worse);
  return (kept[0] & kept[1] & kept[2] & kept[3]) != 0;
}

double share_along(const Vec3& a, const Vec3& b, const Vec3& place) {
  const Vec3 edge = b - a;
  const double length2 = dot(edge, edge);
  return length2 > 0 ? std::clamp(dot(place - a, edge) / length2, 0.0, 1.0) : 0.5;
}

}  // namespace lamina::simplify
