#include "simplify/contraction.h"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr double kLeastCosine = 0.2;  ///< a triangle turns no farther at one contraction

/// Four times the squared area of a triangle over the square of the sum of its squared sides: 1/12 where it is
/// equilateral, 0 where it has no area.
struct Shape {
  double area, sides;
  [[nodiscard]] bool at_least(double quality) const { return 12 * area >= quality * quality * sides * sides; }
  [[nodiscard]] bool worse_than(const Shape& o) const { return area * o.sides * o.sides < o.area * sides * sides; }
};

Shape shape_of(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& twice_area) {
  return {dot(twice_area, twice_area), dot(b - a, b - a) + dot(c - b, c - b) + dot(a - c, a - c)};
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

bool keeps_shape(const Stars& stars, std::span<const Vec3> positions, std::uint32_t u, std::uint32_t v, const Vec3& to,
                 double sliver) {
  for (const auto& [vertex, other] : {std::pair{u, v}, std::pair{v, u}}) {
    const Vec3& from = positions[vertex];
    for (const std::uint32_t triangle : stars.around(vertex)) {
      const Triangle& t = stars.triangles()[triangle];
      if (names(t, other)) continue;
      const std::size_t k = corner_of(t, vertex);
      const Vec3 &p = positions[t[(k + 1) % 3]], &q = positions[t[(k + 2) % 3]];
      const Vec3 before = cross(p - from, q - from), after = cross(p - to, q - to);
      const double along = dot(before, after);
      const Shape shape = shape_of(to, p, q, after);
      if (!(along > 0 && along * along > kLeastCosine * kLeastCosine * dot(before, before) * shape.area)) return false;
      if (!shape.at_least(sliver) && shape.worse_than(shape_of(from, p, q, before))) return false;
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
