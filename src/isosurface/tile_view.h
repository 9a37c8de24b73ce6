// The tiles of a slab, and words of their masks and their neighbours' seen from a tile, so that the passes over it work
// on 64-bit slices alone.
#pragma once
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "lattice/block_mask.h"
#include "lattice/morphology.h"
#include "octree/slab_tiles.h"

namespace lamina {

/// Layer z in [-1, 8] of a mask over the tile and its eight neighbours across the sweep axis.
struct Slice {
  std::array<std::uint64_t, 9> words{};

  Slice() = default;
  Slice(const TileView& tile, BlockMask CornerBlock::*mask, int z) {
    const int base = z < 0 ? 0 : (z < 8 ? 9 : 18);
    for (int i = 0; i < 9; ++i) {
      const CornerBlock* b = tile.leaf().around[base + i];
      words[i] = b == nullptr ? 0 : (b->*mask).words[z & 7];
    }
  }
  [[nodiscard]] std::uint64_t here() const { return words[4]; }
  [[nodiscard]] bool any() const {
    std::uint64_t all = 0;
    for (const std::uint64_t w : words) all |= w;
    return all != 0;
  }
  /// The word whose bit (x, y) is the mask's at (x + DX, y + DY).
  template <int DX, int DY>
  [[nodiscard]] std::uint64_t at() const {
    const auto row = [&](int x) { return bits::shift_y(words[x], words[3 + x], words[6 + x], -DY); };
    if constexpr (DX == 0) return row(1);
    if constexpr (DX > 0) return bits::shift_x(0, row(1), row(2), -DX);
    if constexpr (DX < 0) return bits::shift_x(row(0), row(1), 0, -DX);
  }
};

/// Calls f(bit) for every set bit, lowest first.
template <typename F>
void for_bits(std::uint64_t word, const F& f) {
  for (; word != 0; word &= word - 1) f(std::countr_zero(word));
}

/// Numbers of the isovertices on the edges of a tile's cells, [axis][z][y][x] of the edge's lower corner. Entries
/// without an accepted crossing hold anything.
class EdgeNumbers {
 public:
  static constexpr int offset(int axis, int x, int y, int z) { return axis * 729 + z * 81 + y * 9 + x; }
  [[nodiscard]] std::uint32_t at(int i) const { return numbers_[i]; }

  /// The edges of layer z in [0, 8] that bound cells of the tile; vertical ones only when asked.
  void load(const TileView& tile, int z, std::uint32_t slab_bit, bool vertical) {
    load_axis(tile, 0, 0, 0, z, slab_bit);
    load_axis(tile, 0, 0, 1, z, slab_bit);
    load_axis(tile, 1, 0, 0, z, slab_bit);
    load_axis(tile, 1, 1, 0, z, slab_bit);
    if (!vertical) return;
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) load_axis(tile, 2, dx, dy, z, slab_bit);
    }
  }

 private:
  void load_axis(const TileView& tile, int axis, int dx, int dy, int z, std::uint32_t slab_bit) {
    const CornerBlock* block = tile.neighbour(dx, dy, z >> 3);
    if (block == nullptr) return;
    const std::uint64_t word = block->accepted[axis].words[z & 7];
    const std::uint64_t wanted = word & (dx == 0 ? ~std::uint64_t{0} : bits::columns_below(1)) &
                                 (dy == 0 ? ~std::uint64_t{0} : std::uint64_t{0xFF});
    if (wanted == 0) return;
    std::uint32_t id = block->numbers[z & 7].vertex_base | slab_bit;
    for (int a = 0; a < axis; ++a) id += static_cast<std::uint32_t>(std::popcount(block->accepted[a].words[z & 7]));
    std::uint32_t* const base = numbers_.data() + offset(axis, 8 * dx, 8 * dy, z);
    if (dx == 0) {
      for_bits(wanted, [&](int bit) { base[(bit >> 3) * 9 + (bit & 7)] = id++; });
    } else {
      for_bits(wanted, [&](int bit) {
        base[(bit >> 3) * 9] = id + static_cast<std::uint32_t>(std::popcount(word & ((std::uint64_t{1} << bit) - 1)));
      });
    }
  }

  std::array<std::uint32_t, 3 * 729> numbers_;
};

// Minimal edges with a sign change and the corners at their ends, as masks: the first half of numbering.

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
