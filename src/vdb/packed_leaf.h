// A leaf's record in a .vdb file, made from masks and values without a leaf of OpenVDB's in between.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "lattice/block_mask.h"
#include "vdb/grids.h"

namespace lamina::volume {

/// A leaf as it will stand in the file.
struct PackedLeaf {
  openvdb::Coord origin;
  std::array<std::int8_t, 6> faces{};  ///< LeafVotes::faces
  std::uint32_t active = 0;
  openvdb::CoordBBox box;  ///< of the active voxels
  std::string bytes;
};

/// Masks in the order of OpenVDB's leaves: word x, bit 8 y + z.
struct LeafMasks {
  BlockMask active;
  BlockMask inside;  ///< of the voxels that are not active: minus the background; empty where that is 0
};

/// `values` of the active voxels in the mask's order, `width` (1 or 3) for each. `out` may be an older leaf, whose
/// memory is used again; its faces have no opinion. Safe from several threads.
void pack(const openvdb::Coord& origin, const LeafMasks& masks, std::span<const float> values, int width, bool half,
          PackedLeaf& out);

/// How a leaf's faces vote for the tiles beside them (LeafVotes::faces). `negative`: active voxels inside, those that
/// are not active where LeafMasks::inside is set.
std::array<std::int8_t, 6> face_votes(const BlockMask& active, const BlockMask& negative);
std::array<std::int8_t, 6> face_votes(const openvdb::FloatTree::LeafNodeType& leaf);

}  // namespace lamina::volume
