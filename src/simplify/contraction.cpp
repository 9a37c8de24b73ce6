#include "simplify/contraction.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr double kLeastCosine = 0.2;  ///< a triangle turns no farther at one contraction
constexpr double kSliver = 0.05;      ///< no contraction makes triangles worse than this (1: equilateral)

/// Squared: 1 for equilateral triangles, 0 for those without area.
double shape2(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& twice_area) {
  const double sides = dot(b - a, b - a) + dot(c - b, c - b) + dot(a - c, a - c);
  return 12 * dot(twice_area, twice_area) / (sides * sides);
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

bool keeps_shape(const Stars& stars, std::span<const Vec3> positions, std::uint32_t u, std::uint32_t v,
                 const Vec3& to) {
  for (const auto& [vertex, other] : {std::pair{u, v}, std::pair{v, u}}) {
    const Vec3& from = positions[vertex];
    for (const std::uint32_t triangle : stars.around(vertex)) {
      const Triangle& t = stars.triangles()[triangle];
      if (names(t, other)) continue;
      const std::size_t k = corner_of(t, vertex);
      const Vec3 &p = positions[t[(k + 1) % 3]], &q = positions[t[(k + 2) % 3]];
      const Vec3 before = cross(p - from, q - from), after = cross(p - to, q - to);
      const double along = dot(before, after);
      if (!(along > 0 && along * along > kLeastCosine * kLeastCosine * dot(before, before) * dot(after, after)))
        return false;
      const double shape = shape2(to, p, q, after);
      if (!(shape >= kSliver * kSliver) && shape < shape2(from, p, q, before)) return false;
    }
  }
  return true;
}

double share_along(const Vec3& a, const Vec3& b, const Vec3& place) {
  const Vec3 edge = b - a;
  const double length2 = dot(edge, edge);
  return length2 > 0 ? std::clamp(dot(place - a, edge) / length2, 0.0, 1.0) : 0.5;
}

}  // namespace lamina::simplify
