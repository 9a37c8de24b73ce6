#include "extract/tile_view.h"

#include <algorithm>
#include <tuple>

namespace lamina {
namespace {

auto place(const Block& b) {
  return std::tuple(b.z, b.y, b.x);
}

/// The slab's tiles of a level and those of the block layers under and over it, in order.
std::vector<Tile> with_layers_around(const Window& window, int level, std::int32_t slab) {
  const Lattice& lattice = window.lattice();
  const std::int32_t first = lattice.first_layer(level, slab) >> 3;
  const std::int32_t last = (lattice.first_layer(level, slab) + lattice.layers(level) - 1) >> 3;
  std::vector<Tile> all;
  const auto append = [&](std::int32_t from_slab, std::int32_t z_first, std::int32_t z_last) {
    for (const Tile& t : window.tiles(level, from_slab)) {
      if (t.block.z >= z_first && t.block.z <= z_last) all.push_back(t);
    }
  };
  append(lattice.slab_of_layer(level, first * 8 - 1), first - 1, first - 1);
  append(slab, first, last);
  append(lattice.slab_of_layer(level, last * 8 + 8), last + 1, last + 1);
  return all;
}

void append_views(const Window& window, int level, std::int32_t slab, std::vector<TileView>& views) {
  const std::vector<Tile> all = with_layers_around(window, level, slab);
  const std::int32_t first = window.lattice().first_layer(level, slab);
  const std::int32_t end = first + window.lattice().layers(level);
  // Tiles are in order, so the neighbours in one direction are in order too: nine cursors walk along.
  std::array<std::size_t, 9> cursor{};
  for (const Tile& t : all) {
    if (t.block.z < (first >> 3) || t.block.z > ((end - 1) >> 3)) continue;
    TileView& view = views.emplace_back();
    view.level = level;
    view.block = t.block;
    view.begin = std::max(0, first - t.block.z * 8);
    view.end = std::min(8, end - t.block.z * 8);
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        std::size_t& c = cursor[(dz + 1) * 3 + dy + 1];
        const Block wanted{t.block.x - 1, t.block.y + dy, t.block.z + dz};
        while (c < all.size() && place(all[c].block) < place(wanted)) ++c;
        for (std::size_t i = c; i < all.size(); ++i) {
          const Block& b = all[i].block;
          if (b.z != wanted.z || b.y != wanted.y || b.x > t.block.x + 1) break;
          view.around[TileView::index(b.x - t.block.x, dy, dz)] = all[i].leaf;
        }
      }
    }
  }
}

}  // namespace

std::vector<TileView> slab_tiles(const Window& window, std::int32_t slab) {
  std::vector<TileView> views;
  for (int level = 0; level < window.levels(); ++level) append_views(window, level, slab, views);
  return views;
}

}  // namespace lamina
