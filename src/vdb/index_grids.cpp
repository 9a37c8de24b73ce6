// Points, and what OpenVDB's converters between meshes and volumes work with.
#ifndef LAMINA_GRIDS_IN_OPENVDB
#include "vdb/grids.h"
#include "vdb/points_grid.h"

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {

template class Grid<Int32Tree>;
template class Grid<points::PointDataTree>;
template class tree::Tree<BoolTree::RootNodeType>;
template class tree::Tree<Int32Tree::RootNodeType>;
template class tree::Tree<points::PointDataTree::RootNodeType>;

}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb

#endif
