#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>

#include "extract/crossing.h"
#include "extract/extract.h"
#include "project/corner_value.h"

namespace lamina {
namespace {

/// Runs body(tile, cache) over all tiles, several threads at once; every tile writes its own places.
template <typename Body>
void for_views(const Window& window, const std::vector<TileView>& views, const Body& body) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, views.size(), 16),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      BlockCache cache(window);
                      for (std::size_t i = range.begin(); i < range.end(); ++i) body(views[i], cache);
                    });
}

/// Gives every layer the base of its vertices and corners and sizes the slab's tables.
void assign_numbers(const Window& window, const std::vector<TileView>& views, IsoSlab& out) {
  std::uint32_t vertices = 0;
  std::uint32_t corners = 0;
  for (const TileView& tile : views) {
    CornerBlock& leaf = tile.leaf();
    for (int z = tile.begin; z < tile.end; ++z) {
      leaf.numbers[z] = {vertices, corners};
      for (const BlockMask& m : leaf.accepted) vertices += static_cast<std::uint32_t>(std::popcount(m.words[z]));
      corners += static_cast<std::uint32_t>(std::popcount(leaf.surface.words[z]));
    }
  }
  out.vertices.assign(vertices, {});
  out.corners.assign(corners, {});
  out.corner_attributes.assign(static_cast<std::size_t>(window.attributes()), std::vector<float>(corners));
}

/// Fills in the tile's surface corners. Trusted corners are read here, which is what corner_value() answers for them in
/// the finest level that holds them, without its search.
void fill_corners(const Window& window, const TileView& tile, IsoSlab& out) {
  const CornerBlock& leaf = tile.leaf();
  const int attributes = window.attributes();
  const int brick_layers = window.brick_layers(tile.level);
  std::vector<float> extra(static_cast<std::size_t>(attributes));
  std::uint32_t rank = 0;  // in its brick, of the layer's first corner with a value
  for (int z = tile.begin; z < tile.end; ++z) {
    if (z % brick_layers == 0) rank = 0;
    const std::uint64_t near = leaf.near.words[z];
    const std::uint64_t trusted = near & leaf.good.words[z];
    const std::uint64_t seen = leaf.seen.words[z];
    const CornerValues& values = leaf.values[z / brick_layers];
    std::uint32_t id = leaf.numbers[z].corner_base;
    for_bits(leaf.surface.words[z], [&](int bit) {
      const Cell cell = tile.cell(z * 64 + bit);
      SurfaceCorner& c = out.corners[id];
      c.position = window.lattice().position(tile.level, cell);
      c.cell = static_cast<float>(window.lattice().cell_size(tile.level));
      const std::uint64_t one = std::uint64_t{1} << bit;
      CornerValue value;
      bool valued = true;
      if ((trusted & one) != 0) {
        const float* v = values.of(rank + static_cast<std::uint32_t>(std::popcount(near & (one - 1))));
        value = {v[kDistance], {v[kNormalX], v[kNormalY], v[kNormalZ]}, v[kCurvature], v[kReach]};
        for (int a = 0; a < attributes; ++a) extra[a] = v[kFirstAttribute + a];
      } else {
        valued = corner_value(window, tile.level, cell, value, extra.data());
      }
      if (valued) {
        for (int i = 0; i < 3; ++i) c.offset[i] = -value.distance * value.normal[i];
        c.normal = value.normal;
        c.distance = value.distance;
        c.curvature = value.curvature;
        c.reach = (seen & one) != 0 ? value.reach : -1.0F;
        for (int a = 0; a < attributes; ++a) out.corner_attributes[a][id] = extra[a];
      }
      ++id;
    });
    rank += static_cast<std::uint32_t>(std::popcount(near));
  }
}

/// Where the surface meets an edge. Signs are settled; distances that contradict them (or are missing) only say that
/// it is somewhere between.
float edge_fraction(const SurfaceCorner& low, const SurfaceCorner& high, bool low_positive) {
  constexpr std::array<float, 3> kNone{};
  constexpr float kMargin = 0.01F;  // isovertices stay distinct points
  if (low.normal == kNone || high.normal == kNone) return 0.5F;
  if ((low.distance >= 0) != low_positive || (high.distance >= 0) == low_positive) return 0.5F;
  return std::clamp(low.distance / (low.distance - high.distance), kMargin, 1.0F - kMargin);
}

struct Numbering {
  const Window& window;
  IsoSlab& slab;

  std::uint32_t corner_number(BlockCache& cache, int level, const CornerBlock* block, int offset, const Cell& c) const {
    if (block != nullptr && block->surface.test(offset)) return CornerPlace{block, offset}.number();
    return surface_place(cache, level, c).number();
  }

  /// Completes a vertex whose ends are both known.
  static void place(IsoVertex& v, const SurfaceCorner& low, const SurfaceCorner& high, bool low_positive) {
    v.t = edge_fraction(low, high, low_positive);
    v.near_high = v.t > 0.5F;
  }

  /// Vertices of the tile's edges; vertical edges of the slab's last layer wait for the next slab's corners.
  void fill_vertices(const TileView& tile, BlockCache& cache, std::int32_t last_layer) const {
    const CornerBlock& leaf = tile.leaf();
    for (int z = tile.begin; z < tile.end; ++z) {
      std::uint32_t id = leaf.numbers[z].vertex_base;
      if ((leaf.accepted[0].words[z] | leaf.accepted[1].words[z] | leaf.accepted[2].words[z]) == 0) continue;
      const Slice cells_below(tile, &CornerBlock::cells, z - 1);
      const Slice cells(tile, &CornerBlock::cells, z);
      for (int axis = 0; axis < 3; ++axis) {
        const std::uint64_t edges = leaf.accepted[axis].words[z];
        if (edges == 0) continue;
        const Quadrants full = around_edges(axis, cells_below, cells);
        for_bits(edges, [&](int bit) {
          IsoVertex& v = slab.vertices[id++];
          v.axis = static_cast<std::uint8_t>(axis);
          v.level = static_cast<std::uint8_t>(tile.level);
          for (int q = 0; q < 4; ++q) v.open |= static_cast<std::uint8_t>(((~full.words[q] >> bit) & 1U) << q);
          const int offset = z * 64 + bit;
          const Cell low = tile.cell(offset);
          v.low.bits = corner_number(cache, tile.level, &leaf, offset, low);
          if (axis == 2 && low.z == last_layer) return;
          const Cell high = low + Cell{axis == 0, axis == 1, axis == 2};
          const bool leaves = ((offset >> (3 * axis)) & 7) == 7;
          const CornerBlock* there =
              leaves ? tile.neighbour(axis == 0, axis == 1, axis == 2) : static_cast<const CornerBlock*>(&leaf);
          v.high.bits = corner_number(cache, tile.level, there, offset_in_block(high), high);
          place(v, slab.corners[v.low.index()], slab.corners[v.high.index()], leaf.positive.test(offset));
        });
      }
    }
  }

  /// Completes the slab below: its vertical edges that end in the tile's first layer, the slab's first plane.
  void complete_below(const TileView& tile, BlockCache& cache, IsoSlab& previous) const {
    const CornerBlock* below = tile.neighbour(0, 0, tile.begin == 0 ? -1 : 0);
    if (below == nullptr) return;
    const int z = (tile.begin - 1) & 7;
    std::uint32_t id =
        below->numbers[z].vertex_base + static_cast<std::uint32_t>(std::popcount(below->accepted[0].words[z]) +
                                                                   std::popcount(below->accepted[1].words[z]));
    for_bits(below->accepted[2].words[z], [&](int bit) {
      IsoVertex& v = previous.vertices[id++];
      const int offset = tile.begin * 64 + bit;
      const std::uint32_t high = corner_number(cache, tile.level, &tile.leaf(), offset, tile.cell(offset));
      v.high.bits = high | SlabIndex::kNextSlab;
      place(v, previous.corners[v.low.index()], slab.corners[high], below->positive.test(z * 64 + bit));
    });
  }
};

}  // namespace

void number_edges(Window& window, std::int32_t slab, IsoSlab* previous, IsoSlab& out) {
  out = {};
  out.slab = slab;
  const std::vector<TileView> views = slab_tiles(window, slab);
  for_views(window, views, [](const TileView& tile, BlockCache&) { find_crossing(tile); });
  for (std::size_t first = 0, end = 0; first < views.size(); first = end) {  // level by level, finest first
    while (end < views.size() && views[end].level == views[first].level) ++end;
    tbb::parallel_for(first, end, [&](std::size_t i) { mark_busy(views[i], window); });
  }
  for_views(window, views, [&](const TileView& tile, BlockCache&) { mark_surface(tile, window); });
  assign_numbers(window, views, out);
  for_views(window, views, [&](const TileView& tile, BlockCache&) { fill_corners(window, tile, out); });
  const Numbering numbering{window, out};
  for_views(window, views, [&](const TileView& tile, BlockCache& cache) {
    const std::int32_t first = window.lattice().first_layer(tile.level, slab);
    numbering.fill_vertices(tile, cache, first + window.lattice().layers(tile.level) - 1);
    if (previous != nullptr && tile.block.z * 8 + tile.begin == first) numbering.complete_below(tile, cache, *previous);
  });
}

}  // namespace lamina
