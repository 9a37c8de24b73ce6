// Cell-to-vertex diffusion (Cuccuru et al. 2009, section 3.3): corners take the mean of what the projected centres of
// the cells around them say.
#pragma once
#include <cstdint>

#include "octree/window.h"

namespace lamina {

/// Fills values, `seen` and `trusted` of the slab's active corners from the centres of the leaf cells that touch them,
/// at whatever level, weights inversely proportional to cell size; trusted centres only, where there is one. The
/// centres of this slab and of the one below must be projected (ProjectSettings::centres).
void diffuse_slab(Window& window, std::int32_t slab);

}  // namespace lamina
