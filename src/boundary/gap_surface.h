// Gaps and the smooth surfaces over them, and the triangles of polygons, in a plane or in space.
#pragma once
#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <vector>

#include "boundary/boundary.h"

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

// A gap and the smooth surface over it. The gap: one boundary loop, and those of islands within, as seen from the plane
// that it is filled over. The surface meets this rim in position and, as nearly as a height field can, in normal.

template <class T>
Eigen::Vector3d to_vec(const std::array<T, 3>& v) {
  return Eigen::Vector3d(static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2]));
}

/// A plane through the middle of a boundary loop.
struct Base {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< rows; the last is the normal
  double radius = 0;                                   ///< mean influence radius
  [[nodiscard]] Eigen::Vector3d local(const Eigen::Vector3d& p) const { return axes * (p - middle); }
  [[nodiscard]] Eigen::Vector3d world(const Eigen::Vector3d& p) const { return middle + axes.transpose() * p; }
};

/// Across the mean normal of the loop's vertices.
Base base_of(const Loop& loop);
/// In which the loop encloses most, on the side from which it runs anticlockwise.
Base widest_base(const Loop& loop);

/// The outer loop and the islands', their vertices numbered one loop after the other.
struct Rim {
  Rim(const std::vector<const Loop*>& loops, const Base& seen_from);
  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(points.size()); }
  /// Whether a filling may join two vertices: not where the mesh has an edge already. Those of no rim may always be.
  [[nodiscard]] bool allows(std::uint32_t i, std::uint32_t j) const;
  Base base;
  std::vector<Eigen::Vector3d> points, normals;
  std::vector<Eigen::Vector3d> facing;           ///< of the triangle beside the edge to the next
  std::vector<std::uint32_t> next;               ///< along the vertex' loop
  std::vector<std::uint32_t> begins;             ///< of each loop
  std::set<std::array<std::uint32_t, 2>> taken;  ///< pairs (i < j) that are joined
};

/// Of the outer loop, positive where it runs anticlockwise.
double signed_area(const Rim& rim);

/// The rim in its plane.
std::vector<Eigen::Vector2d> plane_of(const Rim& rim);

/// The same, smoothed until it does not cross itself: rims of noisy samples wind. Nothing where it does so at large.
std::optional<std::vector<Eigen::Vector2d>> simple_outline(const Rim& rim);

/// One polygon around the gap, of the rim's vertices: islands are joined to the outer loop by an edge, which the
/// polygon runs along there and back. Nothing where no edge reaches an island.
std::optional<std::vector<std::uint32_t>> polygon_of(const Rim& rim, const std::vector<Eigen::Vector2d>& outline);

/// Whether a point lies inside a loop.
bool is_inside(const Eigen::Vector2d& point, const std::vector<Eigen::Vector2d>& loop);

/// Normals flatter than this (75 degrees, the cosine) are taken to be just so: beyond, heights say nothing.
inline constexpr double kLeastNormalCosine = 0.26;

/// The quadratic height over the base plane of least squares to the heights and slopes along a rim: it curves to two
/// sides as most surfaces do.
class Quadric {
 public:
  /// `width` of the gap: what a slope weighs against a height.
  Quadric(const Rim& rim, double width);
  [[nodiscard]] double height(const Eigen::Vector2d& at) const;
  [[nodiscard]] Eigen::Vector2d slope(const Eigen::Vector2d& at) const;

 private:
  double scale_;
  Eigen::Vector<double, 6> coefficients_;
};

/// The height field's slopes for a normal as the base sees it.
Eigen::Vector2d slope_of(const Eigen::Vector3d& normal);

/// What is known around a gap.
struct GapRim {
  const Rim& rim;
  const std::vector<bool>& fits;      ///< vertices whose normals tell how the surface goes on
  const Quadric& quadric;             ///< what it does at large
  const Eigen::MatrixXd& attributes;  ///< a row for each of the rim's vertices
};

/// The new vertices, in their order: positions and normals as the base sees them, a row of attributes each.
struct GapSurface {
  std::vector<Eigen::Vector3d> positions, normals;
  Eigen::MatrixXd attributes;
};

/// What the rim rises above the quadric goes on so that slopes are harmonic over the plane and heights those whose
/// slopes are nearest to them (Poisson's equation with the rim's heights: Zhao, Gao and Lin 2007); attributes are
/// harmonic. `plane`: the rim's vertices where the outline has them, then new ones; `triangles` of the whole,
/// Delaunay's for the systems to be well behaved.
GapSurface span_gap(const GapRim& around, const std::vector<Eigen::Vector2d>& plane,
                    const std::vector<PlaneTriangle>& triangles);

}  // namespace lamina::boundary
