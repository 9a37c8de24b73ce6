// Sides of the tiles of an open level set.
#pragma once
#include "vdb/grids.h"

namespace lamina::volume {

/// Decides anew which tiles lie inside, from the leaves beside them (tile_signs.h).
void sign_tiles(openvdb::FloatGrid& grid);

}  // namespace lamina::volume
