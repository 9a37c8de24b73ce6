// What lies behind an open surface, where nothing is known.
#pragma once
#include "vdb/grids.h"

namespace lamina::volume {

/// Gives the voxels and tiles beyond the band that count as inside, and are connected there with the outside, the
/// outside's value. Leaves of the band bring their sign to all of their voxels, and to a tile or two behind them
/// (tile_signs.h); where the surface is open that is an inside of eight voxels' steps. What the band encloses stays.
void empty_open_inside(openvdb::FloatGrid& grid);

}  // namespace lamina::volume
