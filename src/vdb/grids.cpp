#include "vdb/grids.h"

#include "vdb/points_grid.h"

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {

#ifdef LAMINA_GRIDS_IN_OPENVDB
// What its library lacks, as it is inlined there; where another is missing, the linker names it.
template Grid<Vec3STree>::Ptr Grid<Vec3STree>::create(Vec3STree::Ptr);
#else
template class Grid<BoolTree>;
template class Grid<DoubleTree>;
template class Grid<FloatTree>;
template class Grid<Int32Tree>;
template class Grid<Int64Tree>;
template class Grid<MaskTree>;
template class Grid<Vec3DTree>;
template class Grid<Vec3STree>;
template class Grid<points::PointDataTree>;
template class tree::Tree<BoolTree::RootNodeType>;
template class tree::Tree<DoubleTree::RootNodeType>;
template class tree::Tree<FloatTree::RootNodeType>;
template class tree::Tree<Int32Tree::RootNodeType>;
template class tree::Tree<Int64Tree::RootNodeType>;
template class tree::Tree<MaskTree::RootNodeType>;
template class tree::Tree<Vec3DTree::RootNodeType>;
template class tree::Tree<Vec3STree::RootNodeType>;
template class tree::Tree<points::PointDataTree::RootNodeType>;
#endif

}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
