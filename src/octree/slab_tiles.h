// All levels' tiles of a slab together: what stages iterate over that need not wait for one level before the next.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

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

/// Appends the level's tiles of a slab.
inline void add_tiles(const Window& window, int level, std::int32_t slab, std::vector<TileView>& out) {
  for (const Tile& t : window.tiles(level, slab)) {
    const LeafLayers layers = leaf_layers(window, level, slab, t.block);
    out.push_back({t.leaf, level, t.block, layers.begin, layers.end});
  }
}

/// All levels' tiles of a slab in canonical order: level, then z, y, x.
inline std::vector<TileView> slab_tiles(const Window& window, std::int32_t slab) {
  std::vector<TileView> views;
  for (int level = 0; level < window.levels(); ++level) add_tiles(window, level, slab, views);
  return views;
}

/// At the i-th tile, for a later one; `Parts`: those of its block that the pass looks at.
template <typename Parts>
[[gnu::always_inline]] inline void ask_ahead(std::span<const TileView> views, std::size_t i) {
  if (i + kAskedAhead < views.size()) Parts::ask_for(views[i + kAskedAhead].leaf());
}

}  // namespace lamina
