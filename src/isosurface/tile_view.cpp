#include "isosurface/tile_view.h"

#include <algorithm>

namespace lamina {

std::vector<TileView> slab_tiles(const Window& window, std::int32_t slab) {
  std::vector<TileView> views;
  for (int level = 0; level < window.levels(); ++level) {
    const std::int32_t first = window.lattice().first_layer(level, slab);
    const std::int32_t end = first + window.lattice().layers(level);
    for (const Tile& t : window.tiles(level, slab)) {
      views.push_back({t.leaf, level, t.block, std::max(0, first - t.block.z * 8), std::min(8, end - t.block.z * 8)});
    }
  }
  return views;
}

}  // namespace lamina
