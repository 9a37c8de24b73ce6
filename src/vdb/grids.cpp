#include "vdb/grids.h"

// Distances and vectors; index_grids.cpp has the others, for a second processor.

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {

#ifdef LAMINA_GRIDS_IN_OPENVDB
// What its library lacks, as it is inlined there; where another is missing, the linker names it.
template Grid<Vec3STree>::Ptr Grid<Vec3STree>::create(Vec3STree::Ptr);
#else
template class Grid<FloatTree>;
template class Grid<Vec3STree>;
template class tree::Tree<FloatTree::RootNodeType>;
template class tree::Tree<Vec3STree::RootNodeType>;
#endif

}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
