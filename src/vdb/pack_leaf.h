// A leaf's record in a .vdb file, made from masks and values without a leaf of OpenVDB's in between.
#pragma once
#include <cstdint>
#include <span>

#include "lattice/block_mask.h"
#include "vdb/streamed_vdb.h"

namespace lamina::volume {

/// Masks in the order of OpenVDB's leaves: word x, bit 8 y + z.
struct LeafMasks {
  BlockMask active;
  BlockMask inside;  ///< of the voxels that are not active: minus the background; empty where that is 0
};

/// `values` of the active voxels in the mask's order, `width` (1 or 3) for each. `out` may be an older leaf, whose
/// memory is used again; its faces have no opinion.
void pack(const openvdb::Coord& origin, const LeafMasks& masks, std::span<const float> values, int width, bool half,
          PackedLeaf& out);
/// As face_votes() of the leaf; `negative`: active voxels inside, those that are not active where `inside` is set.
std::array<std::int8_t, 6> face_votes(const BlockMask& active, const BlockMask& negative);

}  // namespace lamina::volume
