// A vertex normal between what a fit and the triangles around say of it.
#pragma once
#include <algorithm>

#include "meshes/vec3.h"

namespace lamina {

/// The normal of the triangles around a vertex, by area, counts as much as the fit's where the two are this far apart
/// (radians, 7 degrees; their chord), less by the square of how much nearer they are: small differences are those of
/// flat triangles on a round surface.
inline constexpr double kDoubtfulAngle = 0.12;
/// And no more than so many times as much: triangles are uneven, too.
inline constexpr double kMostByTriangles = 3;

namespace meshes {

/// Both of length one, or zero where nothing is said; so is what comes back.
inline Vec3 settled_normal(const Vec3& by_fit, const Vec3& by_triangles) {
  const Vec3 apart = by_fit - by_triangles;
  const double doubt = dot(apart, apart) / (kDoubtfulAngle * kDoubtfulAngle);
  return unit(by_fit + std::min(doubt, kMostByTriangles) * by_triangles);
}

}  // namespace meshes
}  // namespace lamina
