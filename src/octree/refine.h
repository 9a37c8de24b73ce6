// Adaptive refinement: samples leave their marks in the window, and from these follows which cells of which level
// exist, and which corners are worth projecting (Cuccuru et al. 2009, section 3.4).
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <span>

#include "octree/window.h"

namespace lamina {

/// Where a sample lies and the level its radius asks for.
struct Mark {
  std::int32_t x, y, z;  ///< fixed-point position
  std::uint8_t level;    ///< coarsest level whose cells are small enough for the sample
  float active_radius;   ///< how far it acts on corners, steps, > 0
  std::array<float, 3> normal{};
  float active_height = std::numeric_limits<float>::infinity();  ///< how far along its normal, cells of its level, > 0
};

/// Notes samples' home cells and the corners they act on among those up to two cells away (on each axis the two below
/// and the two above). Any order, from several threads at once, slabs at will ahead of refine_slab(); quick where one
/// sample after the other lies in the same block.
void mark_samples(Window& window, std::span<const Mark> marks);

/// Cells around a sample's home, of its own level, that are refined to that level. The farther they reach, the nearer
/// the mesh is to the truth where density varies: coarse cells begin farther from dense samples. With one, places next
/// to sparse samples open as well; two and three leave equally many gaps.
inline constexpr int kRefinedCells = 3;
/// Cells around the home that finer samples' cells inherit closeness from, and whose centres are projected.
inline constexpr int kCloseCells = 1;

/// Fixes the octree of one slab: cells that samples reach, subdivision, taking part. Samples must be marked up to three
/// slabs further, and the slab below be refined. A cell is split when a sample of a finer level lies within three
/// of that level's cells (Cuccuru et al. 2009, section 3.4, with a wider ball, taken as the cells it can meet).
void refine_slab(Window& window, std::int32_t slab);

/// Cells of the block's layers [begin, end) within one cell of the home of a sample of this or a coarser level, to
/// `out` from its front. The slab must be refined.
void close_cells(const CornerBlock& leaf, int begin, int end, std::uint64_t* out);

/// Fixes the corners of one slab (its layers of corners, the first plane included) and of them the ones to project:
/// those that samples were found to act on, and those of cells close to a sample of a coarser level. The slab and the
/// one below must be refined.
void place_corners(Window& window, std::int32_t slab);

/// Leaf cells of a slab at a level.
std::uint64_t count_cells(const Window& window, int level, std::int32_t slab);

}  // namespace lamina
