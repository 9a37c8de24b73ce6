// The rim of a gap as seen from the plane that the gap is filled over: one boundary loop, and those of islands within.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <set>
#include <vector>

#include <Eigen/Core>

#include "boundary/boundary.h"

namespace lamina::boundary {

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

}  // namespace lamina::boundary
