// Where the vertex of a collapsed component goes when its corner holds several: a quadric collapse (Lindstrom 2000).
#pragma once
#include <array>
#include <span>

#include <Eigen/Core>

namespace lamina::clustering {

/// A triangle that touches the component, points relative to the component's corner in steps.
struct PatchTriangle {
  std::array<Eigen::Vector3d, 3> point;
  std::array<std::uint32_t, 3> vertex;  ///< names; equal names, same vertex
  std::array<bool, 3> member{};         ///< the vertex belongs to the component
};

/// The point that minimises the summed squared distances to the triangles' planes, weighted by squared area (Lindstrom,
/// "Out-of-core simplification of large polygonal models", SIGGRAPH 2000), sought from the mean of the component's
/// vertices by SVD with small singular values dropped, then held within half the patch's box around that mean.
/// The mean itself where the patch has no area. Depends on the order of `triangles` by rounding only.
Eigen::Vector3d place_patch(std::span<const PatchTriangle> triangles);

}  // namespace lamina::clustering
