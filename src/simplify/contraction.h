// What contracting one edge does to a mesh: where the new vertex goes, what it costs, what becomes of the triangles.
#pragma once
#include <cstdint>
#include <span>

#include "meshes/vec3.h"
#include "simplify/quadric.h"
#include "simplify/stars.h"

namespace lamina::simplify {

struct Placed {
  meshes::Vec3 at;
  double cost;  ///< at least 0
};

/// Where the edge from a to b goes, of which `sum` is the quadric of both ends: where that is least, or, where this is
/// nowhere or far off, to an end or the middle.
Placed place_edge(const Quadric& sum, const meshes::Vec3& a, const meshes::Vec3& b);

constexpr double kSliver = 0.05;  ///< no contraction makes triangles worse than this (1: equilateral)

/// Do the triangles that stay when u and v become one vertex at `to` keep their side, and a quality of at least
/// `sliver` where they had it?
bool keeps_shape(const Stars& stars, std::span<const meshes::Vec3> positions, std::uint32_t u, std::uint32_t v,
                 const meshes::Vec3& to, double sliver = kSliver);

/// How far along the edge from a to b a place is: 0 at a, 1 at b.
double share_along(const meshes::Vec3& a, const meshes::Vec3& b, const meshes::Vec3& place);

}  // namespace lamina::simplify
