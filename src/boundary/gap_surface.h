// The smooth surface over a gap: it meets the rim in position and, as nearly as a height field can, in normal.
#pragma once
#include <vector>

#include <Eigen/Core>

#include "boundary/gap_rim.h"
#include "boundary/triangulate_polygon.h"

namespace lamina::boundary {

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
