// Samples leave their marks in the window ahead of refinement: the cells they lie in and the corners they act on.
#pragma once
#include <cstdint>
#include <span>

#include "octree/window.h"

namespace lamina {

/// Where a sample lies and the level its radius asks for.
struct Mark {
  std::int32_t x, y, z;  ///< fixed-point position
  std::uint8_t level;    ///< coarsest level whose cells are small enough for the sample
  float active_radius;   ///< how far it acts on corners, steps, > 0
};

/// Notes samples' home cells and the corners they act on among those up to two cells away (on each axis the two below
/// and the two above). Any order, from several threads at once, slabs at will ahead of refine_slab(); quick where one
/// sample after the other lies in the same block.
void mark_samples(Window& window, std::span<const Mark> marks);

}  // namespace lamina
