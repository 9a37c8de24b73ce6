// The buffers of a grid of points in a .vdb file: whether their lengths are true.
#pragma once
#include <cstdint>

#include "vdb/vdb_walker.h"

namespace lamina::volume {

/// Walks through the passes in which OpenVDB writes the attributes of so many leaves, from behind the tree's topology
/// to the grid's end: arrays must be as long as they say, pages must hold what is taken out of them, and compressed
/// pieces must be sound. Throws as check_vdb() does. `version` of the file.
void check_points(Walker& w, std::uint64_t leaves, std::uint32_t version);

}  // namespace lamina::volume
