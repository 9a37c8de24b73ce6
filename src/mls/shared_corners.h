// Values of corners that several levels hold.
#pragma once
#include "octree/finer_corner.h"

namespace lamina {

/// Makes room for the values of the active points in layers [begin, end) of a block (one slab's); false when there are
/// none.
bool allocate_values(const Window& window, int level, Projected& points, int begin, int end);

/// The tile's shared corner at `bit` of layer z, where it counts.
FinerCorner finer_corner(const Window& window, int level, const Tile& tile, int z, int bit);

/// Takes over `seen`, `trusted` and the signs of a layer's shared corners that are active.
void take_shared(const Window& window, int level, const Tile& tile, int z);
/// Copies the finer level's values to place `at` of the coarser one's.
void copy_value(const Window& window, const FinerCorner& from, CornerValues& to, std::uint32_t at);

/// Takes over what finer levels have for the tile's shared corners in layers [begin, end).
void copy_shared(Window& window, int level, const Tile& tile, int begin, int end);

}  // namespace lamina
