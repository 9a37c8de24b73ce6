// Which side of the surface the voxels of a block lie on, those beside the band as well.
#pragma once
#include "octree/corner_block.h"

namespace lamina::volume {

/// Voxels nobody knows take the side of the nearest that somebody does, outside first. `negative`: of `known`.
BlockMask inside_of(const BlockMask& negative, const BlockMask& known);

}  // namespace lamina::volume
