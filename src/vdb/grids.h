// OpenVDB's grids, compiled once, in grids.cpp and index_grids.cpp: otherwise every source that makes a grid compiles
// the whole of Grid and Tree for their virtual functions (5 to 10 s a type, three times that under sanitizers). Only
// what is made here or by OpenVDB's tools at our call needs that; grids of other types come out of files only. With
// LAMINA_FUZZ every source compiles its own, so that the fuzzer sees inside.
#pragma once
#include <openvdb/openvdb.h>

#ifndef LAMINA_FUZZ
namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {

extern template class Grid<FloatTree>;
extern template class Grid<Int32Tree>;
extern template class Grid<Vec3STree>;
extern template class tree::Tree<BoolTree::RootNodeType>;
extern template class tree::Tree<FloatTree::RootNodeType>;
extern template class tree::Tree<Int32Tree::RootNodeType>;
extern template class tree::Tree<Vec3STree::RootNodeType>;

}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
#endif
