// Moving, turning and scaling points and meshes.
#pragma once
#include <Eigen/Geometry>

#include "lamina/mesh.h"
#include "lamina/sample.h"

namespace lamina {

/// In the order in which they are applied, about the pivot: scale, rotate (about x, then y, then z), translate.
struct TransformSettings {
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  Eigen::Vector3d rotate = Eigen::Vector3d::Zero();  ///< degrees
  Eigen::Vector3d translate = Eigen::Vector3d::Zero();
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();
};

/// p' = pivot + translate + R S (p - pivot). Quarter turns are exact.
Eigen::Affine3d make_transform(const TransformSettings& settings);

/// Throws Error(usage) when the map is not finite, flattens space (determinant 0) or its last row is not 0 0 0 1.
void require_invertible(const Eigen::Matrix4d& matrix);

/// Positions in double. Normals go by the inverse transpose and keep their length, radii by the cube root of the
/// change of volume; everything else stays.
void transform_rows(SampleBatch& batch, const Eigen::Affine3d& transform);
/// Likewise; where the map mirrors, triangles turn round so that the outside stays outside.
void transform_mesh(TriangleMesh& mesh, const Eigen::Affine3d& transform);

/// True when float positions would hold the box less well than a millionth of its diagonal.
bool wants_double(const Eigen::Vector3d& low, const Eigen::Vector3d& high);

}  // namespace lamina
