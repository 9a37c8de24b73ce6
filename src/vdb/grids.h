// OpenVDB's grids, compiled once, in grids.cpp: otherwise every source that makes a grid compiles the whole of Grid and
// Tree for their virtual functions (5 to 10 s a type, three times that under sanitizers). With LAMINA_FUZZ every source
// does, so that the fuzzer sees inside.
#pragma once
#include <openvdb/openvdb.h>

#ifndef LAMINA_FUZZ
namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {

extern template class Grid<BoolTree>;
extern template class Grid<DoubleTree>;
extern template class Grid<FloatTree>;
extern template class Grid<Int32Tree>;
extern template class Grid<Int64Tree>;
extern template class Grid<MaskTree>;
extern template class Grid<Vec3DTree>;
extern template class Grid<Vec3STree>;
extern template class tree::Tree<BoolTree::RootNodeType>;
extern template class tree::Tree<DoubleTree::RootNodeType>;
extern template class tree::Tree<FloatTree::RootNodeType>;
extern template class tree::Tree<Int32Tree::RootNodeType>;
extern template class tree::Tree<Int64Tree::RootNodeType>;
extern template class tree::Tree<MaskTree::RootNodeType>;
extern template class tree::Tree<Vec3DTree::RootNodeType>;
extern template class tree::Tree<Vec3STree::RootNodeType>;

}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
#endif
