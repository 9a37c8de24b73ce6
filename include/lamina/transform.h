// Moving, rotating and scaling points and meshes.
#pragma once
#include <Eigen/Geometry>

#include "lamina/mesh.h"
#include "lamina/sample.h"

namespace lamina {

/// Applied in this order, about the pivot: scale, rotate about x, then y, then z, translate.
struct TransformSettings {
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  Eigen::Vector3d rotate = Eigen::Vector3d::Zero();  ///< degrees
  Eigen::Vector3d translate = Eigen::Vector3d::Zero();
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
};

/// p' = pivot + translate + R S (p - pivot). Quarter turns are exact. Throws as require_invertible() does.
Eigen::Affine3d make_transform(const TransformSettings& settings);

/// Throws Error(usage) when the matrix is not finite, its determinant is 0 (below 1e-12 of its size) or its last row is
/// not 0 0 0 1.
void require_invertible(const Eigen::Matrix4d& matrix);

/// Maps positions in double precision, normals by the inverse transpose with their length kept, and radii by the cube
/// root of the change of volume. Everything else stays.
void transform_rows(SampleBatch& batch, const Eigen::Affine3d& transform);
/// The same for a mesh. Where the map mirrors, triangles are reversed so that the outside stays outside.
void transform_mesh(TriangleMesh& mesh, const Eigen::Affine3d& transform);

/// True when rounding positions to float would cost more than a millionth of the diagonal of the box low..high.
bool wants_double(const Eigen::Vector3d& low, const Eigen::Vector3d& high);

}  // namespace lamina
