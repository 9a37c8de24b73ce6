// Closest point of a triangle.
#pragma once
#include "meshes/vec3.h"

namespace lamina::measure {

/// Squared distance from p to the segment a-b (a == b allowed).
inline double squared_distance_to_segment(const meshes::Vec3& p, const meshes::Vec3& a, const meshes::Vec3& b) {
  using namespace meshes;
  const Vec3 ab = b - a, ap = p - a;
  const double length2 = dot(ab, ab);
  const double t = length2 > 0 ? std::fmin(1.0, std::fmax(0.0, dot(ap, ab) / length2)) : 0.0;
  const Vec3 d = ap - t * ab;
  return dot(d, d);
}

/// Squared distance from p to the triangle a b c. A triangle of no area (an angle below 1e-12, where its normal would
/// be rounding noise) is the segments of its sides.
inline double squared_distance_to_triangle(const meshes::Vec3& p, const meshes::Vec3& a, const meshes::Vec3& b,
                                           const meshes::Vec3& c) {
  using namespace meshes;
  const Vec3 ab = b - a, ac = c - a, ap = p - a;
  const Vec3 n = cross(ab, ac);
  const double n2 = dot(n, n);
  if (n2 > 1e-24 * dot(ab, ab) * dot(ac, ac)) {
    // Barycentric coordinates of the projection; inside, the distance is the height over the plane.
    const double wc = dot(cross(ab, ap), n), wb = dot(cross(ap, ac), n);
    if (wb >= 0 && wc >= 0 && wb + wc <= n2) {
      const double h = dot(ap, n);
      return h * h / n2;
    }
  }
  return std::fmin(squared_distance_to_segment(p, a, b),
                   std::fmin(squared_distance_to_segment(p, b, c), squared_distance_to_segment(p, c, a)));
}

}  // namespace lamina::measure
