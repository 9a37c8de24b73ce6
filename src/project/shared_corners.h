// Values of corners that several levels hold.
#pragma once
#include "window/window.h"

namespace lamina {

/// Makes room for the values of the near points in layers [begin, end) of a block (one slab's); false when there are
/// none.
bool allocate_values(const Window& window, int level, Projected& points, int begin, int end);

/// Takes over what the next finer level has for the tile's shared corners in layers [begin, end).
void copy_shared(Window& window, int level, const Tile& tile, int begin, int end);

}  // namespace lamina
