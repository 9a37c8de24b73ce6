// Points in .vdb files (volume_points.h): plain arrays become the leaves of OpenVDB's points grid.
#pragma once
#include <openvdb/points/PointDataGrid.h>

#include <cstdint>

#include "lamina/volume_points.h"
#include "vdb/grids.h"

#ifndef LAMINA_FUZZ
namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {

extern template class Grid<points::PointDataTree>;
extern template class tree::Tree<points::PointDataTree::RootNodeType>;

}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
#endif

namespace lamina::volume {

/// The grid as write_point_volume() describes it, without name or creator. `voxel`: PointVolumeSettings::voxel. Throws
/// Error: usage (two columns of one name, a voxel too small), budget (its tree would take more than `most_bytes`; 0:
/// than the machine has).
openvdb::points::PointDataGrid::Ptr point_grid(const PointArrays& points, double voxel = 0,
                                               std::uint64_t most_bytes = 0);

/// Grid metadata: the types of the arrays a column was made of, behind this prefix and its name.
inline constexpr const char* kTypeMetadata = "type_";

}  // namespace lamina::volume
