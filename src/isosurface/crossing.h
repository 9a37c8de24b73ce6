// Minimal edges with a sign change and the corners at their ends, as masks: the first half of numbering.
#pragma once
#include "isosurface/tile_view.h"
#include "octree/window.h"

namespace lamina {

/// Sets `crossing` and `accepted` in the tile's layers of the slab, `busy` as far as its own edges go, and notes the
/// layers with ends of accepted edges, in the tile and beyond, in `surface_layers`. A slab is numbered once: `surface`
/// is empty there.
void find_crossing(const TileView& tile);

/// Completes `busy` in the layers of a tile above the finest level, once it is complete in the level below.
void add_finer_busy(const TileView& tile, const Window& window);

/// Sets `surface` for the corners of the tile's layers that end an accepted edge, edges from the layer below included.
/// A corner that several levels hold is marked in the finest only, possibly in another tile: all tiles of the slab must
/// have been through find_crossing(), and the tiles of finer levels be marked; several of a level may be marked at
/// once.
void mark_surface(const TileView& tile, Window& window);

/// A corner's place in the table of its slab.
struct CornerPlace {
  const CornerBlock* block = nullptr;
  int offset = 0;
  int level = 0;
  [[nodiscard]] std::uint32_t number() const;
};

/// Where the corner of an accepted edge is marked: in `level` or a finer one. Its block is null when it is not.
CornerPlace surface_place(BlockCache& cache, int level, const Cell& corner);

/// Cells around the tile's edges of one axis at layer z, by quadrant (IsoVertex::open).
struct Quadrants {
  std::array<std::uint64_t, 4> words{};
  [[nodiscard]] std::uint64_t any() const { return words[0] | words[1] | words[2] | words[3]; }
};
/// `below` and `here` are a mask of cells at layers z - 1 and z.
Quadrants around_edges(int axis, const Slice& below, const Slice& here);

}  // namespace lamina
