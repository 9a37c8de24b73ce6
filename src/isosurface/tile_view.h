// The tiles of a slab, and words of their masks and their neighbours' seen from a tile, so that the passes over it work
// on 64-bit slices alone.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lattice/morphology.h"
#include "octree/window.h"

namespace lamina {

/// A leaf and the layers of it that belong to the slab.
struct TileView {
  CornerBlock* corners = nullptr;
  int level = 0;
  Block block;
  int begin = 0, end = 0;  ///< leaf layers [begin, end)

  [[nodiscard]] CornerBlock& leaf() const { return *corners; }
  [[nodiscard]] CornerBlock* neighbour(int dx, int dy, int dz) const {
    return corners->around[CornerBlock::towards(dx, dy, dz)];
  }
  [[nodiscard]] Cell cell(int offset) const {
    return {block.x * 8 + (offset & 7), block.y * 8 + ((offset >> 3) & 7), block.z * 8 + (offset >> 6)};
  }
};

/// All levels' tiles of a slab in canonical order: level, then z, y, x.
inline std::vector<TileView> slab_tiles(const Window& window, std::int32_t slab) {
  std::vector<TileView> views;
  for (int level = 0; level < window.levels(); ++level) {
    for (const Tile& t : window.tiles(level, slab)) {
      const LeafLayers layers = leaf_layers(window, level, slab, t.block);
      views.push_back({t.leaf, level, t.block, layers.begin, layers.end});
    }
  }
  return views;
}

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

}  // namespace lamina
