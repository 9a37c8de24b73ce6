// Triangles of a polygon, in a plane or in space.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace lamina::boundary {

using PlaneTriangle = std::array<std::uint32_t, 3>;

/// Twice the area between two vectors of the plane, positive when `b` lies anticlockwise of `a`.
inline double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Polygon, anticlockwise, whose corners also have a height. Chords (i, j), i < j, may be used where `allowed`.
/// The triangulation whose sharpest fold (between two triangles, or with `facing`, the normal beside each edge) is
/// least, and among those the one of least area (dynamic programming, n^3 / 6 steps: Klincsek 1980, Barequet and
/// Sharir 1995, Liepa 2003). Nothing where every one has a triangle that is no proper one of the plane.
std::optional<std::vector<PlaneTriangle>> triangulate_polygon(
    const std::vector<Eigen::Vector3d>& corners, const std::vector<Eigen::Vector3d>& facing,
    const std::function<bool(std::uint32_t, std::uint32_t)>& allowed);

/// The triangulation of least area of a polygon in space, however it winds. Nothing where every one has a triangle
/// without area, or a chord that is not allowed.
std::optional<std::vector<PlaneTriangle>> triangulate_by_area(
    const std::vector<Eigen::Vector3d>& corners, const std::function<bool(std::uint32_t, std::uint32_t)>& allowed);

/// Some triangulation of a polygon of the plane, anticlockwise, by cutting off ears (n^2 steps): for those too long to
/// plan, before edges are flipped. `polygon`: its corners, numbers of `points`, which may run along an edge there and
/// back. Takes chords that are not allowed only where no other ear is left: refine_triangles() splits them. Nothing
/// where none is left at all.
std::optional<std::vector<PlaneTriangle>> triangulate_by_ears(
    const std::vector<Eigen::Vector2d>& points, const std::vector<std::uint32_t>& polygon,
    const std::function<bool(std::uint32_t, std::uint32_t)>& allowed);

/// Adds points inside until triangles are about as large as the edges of the polygon around them (Liepa 2003), larger
/// ones farther inside, and flips edges to Delaunay's in the plane; splits edges inside that are not allowed. `points`:
/// the polygon's corners, then what is added; `scale`: the length of edges wanted at each.
void refine_triangles(std::vector<Eigen::Vector2d>& points, std::vector<double>& scale,
                      std::vector<PlaneTriangle>& triangles,
                      const std::function<bool(std::uint32_t, std::uint32_t)>& allowed);

}  // namespace lamina::boundary
