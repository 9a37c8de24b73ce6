// The isovertices on the edges of a tile's cells, by their numbers.
#pragma once
#include <array>
#include <bit>
#include <cstdint>

#include "isosurface/tile_view.h"
#include "lattice/block_mask.h"

namespace lamina {

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

}  // namespace lamina
