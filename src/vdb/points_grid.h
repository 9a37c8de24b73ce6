// Building the leaves of an OpenVDB points grid from plain arrays.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lamina/volume_points.h"
#include "vdb/point_grids.h"

namespace lamina::volume {

/// One array of the points grid, and the arrays of the cloud it is made of.
struct PointColumn {
  enum class Kind : std::uint8_t { float32, int32, vector };
  std::string name;
  Kind kind = Kind::float32;
  std::array<const float*, 3> from{};  ///< one for scalars
  float scale = 1;
  std::string types;  ///< of the attributes it came from, for the way back
};

/// What the arrays become; P is not among them. Throws Error(usage) for a name given twice.
std::vector<PointColumn> point_columns(const PointArrays& points);

/// The voxel's edge: a power of two, so that floats stay what they are; with `wanted` 0 some eight points a voxel were
/// they spread over a surface.
double point_voxel(const SampleBatch& samples, double wanted);

/// A transform of a power-of-two voxel, offset by whole voxels where the numbers of voxels would not fit.
openvdb::math::Transform::Ptr point_transform(const PointArrays& points, double voxel);

/// The grid, without name or creator. Points are ordered by leaf, voxel and row. Throws Error(budget) where its tree
/// would take more than `most_bytes`; 0: than the machine has.
openvdb::points::PointDataGrid::Ptr point_grid(const PointArrays& points, const std::vector<PointColumn>& columns,
                                               const openvdb::math::Transform::Ptr& transform,
                                               std::uint64_t most_bytes = 0);

/// Grid metadata: the types of the arrays a column was made of, behind this prefix and its name.
inline constexpr const char* kTypeMetadata = "type_";

}  // namespace lamina::volume
