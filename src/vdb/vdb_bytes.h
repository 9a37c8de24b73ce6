// OpenVDB's file format, made in memory.
#pragma once

#include <string>

#include "vdb/grids.h"

namespace lamina::volume {

/// A .vdb file of the grids, Blosc-compressed. Unlike OpenVDB's own writer, which draws a random tag for each file, the
/// tag is made from the contents: equal grids give equal bytes.
std::string vdb_bytes(const openvdb::GridCPtrVec& grids);

}  // namespace lamina::volume
