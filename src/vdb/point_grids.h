// OpenVDB's points, compiled once, in grids.cpp (see grids.h).
#pragma once
#include <openvdb/points/PointDataGrid.h>

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
