#include "isosurface/extract.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <span>

#include "base/vectors.h"
#include "isosurface/tile_view.h"
#include "mls/extension.h"
#include "mls/overhang.h"
#include "mls/sheets.h"

namespace lamina {
namespace {

constexpr std::size_t kViewsAtOnce = 12;  ///< fewer would not be worth a cache

/// Runs body(tile, cache) over all tiles, several threads at once; every tile writes its own places. `Parts`: what the
/// body looks at of each tile's block.
template <typename Parts, typename Body>
void for_views(const Window& window, const std::vector<TileView>& views, const Body& body) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, views.size(), kViewsAtOnce),
      [&](const tbb::blocked_range<std::size_t>& range) {
        BlockCache cache(window);
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          ask_ahead<Parts>(views, i);
          body(views[i], cache);
        }
      },
      window.affinity());
}

/// Runs body(tile) over them, where there is little to do for each.
template <typename Body>
void for_cheap_views(std::span<const TileView> views, const Body& body) {
  constexpr std::size_t kAtOnce = 32;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, views.size(), kAtOnce), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) body(views[i]);
  });
}

/// Tiles that have edges below them are busy, too, level by level.
void find_finer_busy(const std::vector<TileView>& views, const Window& window) {
  for (std::size_t first = 0, end = 0; first < views.size(); first = end) {
    while (end < views.size() && views[end].level == views[first].level) ++end;
    if (views[first].level == 0) continue;
    for_cheap_views(std::span(views).subspan(first, end - first),
                    [&](const TileView& tile) { add_finer_busy(tile, window); });
  }
}

/// The tiles in which accepted edges begin or end.
std::vector<TileView> at_surface(const std::vector<TileView>& views) {
  std::vector<TileView> out;
  for (std::size_t i = 0; i < views.size(); ++i) {
    ask_ahead<BlockParts<&CornerBlock::surface_layers>>(views, i);
    const TileView& tile = views[i];
    const unsigned layers = (1U << tile.end) - (1U << tile.begin);
    if ((tile.leaf().surface_layers & layers) != 0) out.push_back(tile);
  }
  return out;
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
  resize_anew(out.vertices, vertices);
  resize_anew(out.corners, corners);
  resize_anew(out.rare, window.has_rare() ? corners : 0);
  out.corner_attributes.resize(static_cast<std::size_t>(window.attributes()));
  for (std::vector<float>& a : out.corner_attributes) resize_anew(a, corners);
}

/// Beyond a boundary, and around things thinner than a cell, neighbours' planes lead far away from all samples: the
/// projected point of a corner that is not trusted stays near the average of its own samples, where its record leads
/// (at `cell`).
void clamp_to_samples(const float* record, float cell, std::array<float, 3>& offset) {
  std::array<float, 3> away{};
  float d2 = 0;
  for (int i = 0; i < 3; ++i) {
    away[i] = offset[i] + record[kDistance] * record[kNormalX + i];
    d2 += away[i] * away[i];
  }
  const float longest = kFarthestFromSamples * cell;
  if (d2 <= longest * longest) return;
  const float back = 1.0F - longest / std::sqrt(d2);
  for (int i = 0; i < 3; ++i) offset[i] -= back * away[i];
}

/// Side of the cells in which the finest level that holds a corner measures, steps.
float cell_of_value(const Window& window, int level, const Cell& corner) {
  const CornerBlock* const block = window.probe(level, block_of(corner));
  if (block->shared.test(offset_in_block(corner))) {
    const FinerCorner finer = finer_corner(window, level, corner);
    return cell_of_value(window, finer.level, finer.corner);
  }
  return static_cast<float>(window.lattice().cell_size(level));
}

/// Takes the corner's vertex to the sharp edge that its record knows of.
void put_on_crease(const float* record, float cell, SurfaceCorner& c) {
  meshes::Vec3 place{};
  meshes::Vec3 normal{};
  if (!unpacked_crease(record + kCrease, place, normal)) return;
  for (int k = 0; k < 3; ++k) c.offset[k] = cell * static_cast<float>(place[k]);
  c.normal = meshes::to_float(normal);
  c.curvature = 0;
  c.crease = true;
}

/// How far the surface reaches beyond its samples at a corner; what its own lean tells, where Numbering is to ask its
/// neighbours only if the corner is wanted. `record`: null where it has no samples of its own.
void put_overhang(const CornerPlace& at, const float* record, int slab_layers, const CornerRule& rule,
                  const std::array<float, 3>& normal, SurfaceCorner& c, RareCorner& rare) {
  if (record != nullptr) {
    rare.overhang = own_overhang(record, normal);
    if (rare.overhang < kUpright * rule.trim && at.block->trusted.test(at.offset)) return;
    c.leaning = !rule.all_overhangs && !c.crease;
    if (c.leaning) return;
  }
  rare.overhang = overhang(*at.block, at.offset, slab_layers, normal);
}

/// Fills in the tile's surface corners. Trusted corners are read here, which is what corner_value() answers for them in
/// the finest level that holds them, without its search.
void fill_corners(const Window& window, const TileView& tile, const CornerRule& rule, IsoSlab& out) {
  const CornerBlock& leaf = tile.leaf();
  const int attributes = window.attributes();
  const int first = window.first_attribute();
  const int slab_layers = window.slab_layers(tile.level);
  const auto size = static_cast<float>(window.lattice().cell_size(tile.level));
  std::vector<float> extra(static_cast<std::size_t>(attributes));
  std::uint32_t rank = 0;  // among its slab's values, of the layer's first corner with a value
  for (int z = tile.begin; z < tile.end; ++z) {
    if (z % slab_layers == 0) rank = 0;
    const std::uint64_t active = leaf.active.words[z];
    const std::uint64_t trusted = active & leaf.trusted.words[z];
    const std::uint64_t doubtful = active & leaf.seen.words[z] & ~trusted;
    const CornerValues& values = leaf.values[z / slab_layers];
    std::uint32_t id = leaf.numbers[z].corner_base;
    for_bits(leaf.surface.words[z], [&](int bit) {
      const Cell cell = tile.cell(z * 64 + bit);
      const std::uint64_t one = std::uint64_t{1} << bit;
      const auto record = [&] {
        return values.of(rank + static_cast<std::uint32_t>(std::popcount(active & (one - 1))));
      };
      SurfaceCorner c;
      c.position = window.lattice().position(tile.level, cell);
      c.cell = size;
      CornerValue value;
      if ((trusted & one) != 0) {
        const float* const v = record();
        value = {v[kDistance], {v[kNormalX], v[kNormalY], v[kNormalZ]}, v[kCurvature], v[kOffsetFromMean]};
        for (int a = 0; a < attributes; ++a) extra[a] = v[first + a];
        c.trusted = value.offset_from_mean >= 0;
      } else {
        corner_value(window, tile.level, cell, value, extra.data());  // there is one: both ends of the edge are defined
      }
      for (int i = 0; i < 3; ++i) c.offset[i] = -value.distance * value.normal[i];
      if ((doubtful & one) != 0 && rule.doubtful == DoubtfulPoints::near_samples)
        clamp_to_samples(record(), size, c.offset);
      c.normal = value.normal;
      c.distance = value.distance;
      c.curvature = value.curvature;
      if (leaf.creased.test(z * 64 + bit) &&
          takes_crease(window, tile.level, cell, static_cast<std::int32_t>(out.slab), record()))
        put_on_crease(record(), cell_of_value(window, tile.level, cell), c);
      const float* const own = (leaf.seen.words[z] & active & one) != 0 ? record() : nullptr;
      if (window.has_rare()) {
        RareCorner& rare = out.rare[id];
        rare = {};
        if (own != nullptr) rare.density = own[kDensity];
        if (rule.trim > 0)
          put_overhang({&leaf, z * 64 + bit, tile.level}, own, slab_layers, rule, value.normal, c, rare);
      }
      for (int a = 0; a < attributes; ++a) out.corner_attributes[a][id] = extra[a];
      out.corners[id++] = c;
    });
    rank += static_cast<std::uint32_t>(std::popcount(active));
  }
}

/// Completes a vertex whose ends are both known: the surface meets the edge where the distances, whose signs differ,
/// pass through zero.
void place(IsoVertex& v, const SurfaceCorner& low, const SurfaceCorner& high) {
  // Which end is the nearer one is as good as random, and std::clamp() asks.
  const float t = low.distance / (low.distance - high.distance);
  v.t = std::min(std::max(t, kEdgeMargin), 1.0F - kEdgeMargin);
  v.near_high = v.t > 0.5F;
}

class Numbering {
 public:
  Numbering(IsoSlab& slab, BlockCache& cache) : slab_(slab), cache_(cache) {}

  /// Vertices of the tile's edges; vertical edges of the slab's last layer wait for the next slab's corners.
  void fill_vertices(const TileView& tile, std::int32_t last_layer) {
    const CornerBlock& leaf = tile.leaf();
    for (int z = tile.begin; z < tile.end; ++z) {
      if ((leaf.accepted[0].words[z] | leaf.accepted[1].words[z] | leaf.accepted[2].words[z]) == 0) continue;
      const Slice cells_below(tile, &CornerBlock::cells, z - 1);
      const Slice cells(tile, &CornerBlock::cells, z);
      std::uint32_t id = leaf.numbers[z].vertex_base;
      id = fill_axis<0>(tile, z, around_edges(0, cells_below, cells), true, id);
      id = fill_axis<1>(tile, z, around_edges(1, cells_below, cells), true, id);
      fill_axis<2>(tile, z, around_edges(2, cells_below, cells), tile.block.z * 8 + z != last_layer, id);
    }
  }

  /// Completes the slab below: its vertical edges that end in the tile's first layer, the slab's first plane.
  void complete_below(const TileView& tile, IsoSlab& previous) {
    const CornerBlock* below = tile.neighbour(0, 0, tile.begin == 0 ? -1 : 0);
    if (below == nullptr) return;
    const int z = (tile.begin - 1) & 7;
    std::uint32_t id =
        below->numbers[z].vertex_base + static_cast<std::uint32_t>(std::popcount(below->accepted[0].words[z]) +
                                                                   std::popcount(below->accepted[1].words[z]));
    for_bits(below->accepted[2].words[z], [&](int bit) {
      IsoVertex& v = previous.vertices[id++];
      const CornerPlace high = corner_place(tile, &tile.leaf(), tile.begin * 64 + bit, {0, 0, 0});
      const std::uint32_t number = high.number();
      v.high.bits = number | SlabIndex::kNextSlab;
      place(v, previous.corners[v.low.index()], slab_.corners[number]);
      if (v.near_high) average_overhang(high, number);
    });
  }

 private:
  /// The corner at an offset of one of the tile's blocks, `beyond` blocks away.
  CornerPlace corner_place(const TileView& tile, const CornerBlock* block, int offset, const Cell& beyond) {
    if (block != nullptr && block->surface.test(offset)) return {block, offset, tile.level};
    const Cell c = tile.cell(offset) + Cell{beyond.x * 8, beyond.y * 8, beyond.z * 8};
    return surface_place(cache_, tile.level, c);
  }

  /// Of a corner that an isovertex is nearest to. Threads may ask for the same one.
  void average_overhang(const CornerPlace& at, std::uint32_t number) {
    SurfaceCorner& c = slab_.corners[number];
    const std::atomic_ref<bool> leaning(c.leaning);
    if (!leaning.load(std::memory_order_relaxed) || !leaning.exchange(false, std::memory_order_relaxed)) return;
    slab_.rare[number].overhang = overhang(*at.block, at.offset, cache_.window().slab_layers(at.level), c.normal);
  }

  /// Vertices of a layer's edges along an axis, the first of which is `id`; returns the number behind the last.
  /// `full`: cells around them.
  template <int kAxis>
  std::uint32_t fill_axis(const TileView& tile, int z, const Quadrants& full, bool both_ends, std::uint32_t id) {
    constexpr Cell kBeyond{kAxis == 0, kAxis == 1, kAxis == 2};
    const CornerBlock& leaf = tile.leaf();
    const CornerBlock* const next = tile.neighbour(kBeyond.x, kBeyond.y, kBeyond.z);
    const std::uint64_t open = ~(full.words[0] & full.words[1] & full.words[2] & full.words[3]);
    for_bits(leaf.accepted[kAxis].words[z], [&](int bit) {
      const int offset = z * 64 + bit;
      IsoVertex v;
      v.axis = kAxis;
      v.level = static_cast<std::uint8_t>(tile.level);
      if (((open >> bit) & 1U) != 0) {
        for (int q = 0; q < 4; ++q) v.open |= static_cast<std::uint8_t>(((~full.words[q] >> bit) & 1U) << q);
      }
      const CornerPlace low = corner_place(tile, &leaf, offset, {0, 0, 0});
      v.low.bits = low.number();
      if (both_ends) {
        constexpr int kStep = 1 << (3 * kAxis);
        constexpr int kLast = 7 * kStep;
        const bool leaves = (offset & kLast) == kLast;
        const CornerPlace high = leaves ? corner_place(tile, next, offset - kLast, kBeyond)
                                        : corner_place(tile, &leaf, offset + kStep, {0, 0, 0});
        v.high.bits = high.number();
        place(v, slab_.corners[v.low.index()], slab_.corners[v.high.index()]);
        if (v.near_high) average_overhang(high, v.high.index());
      }
      // An upper end yet to come may be the farther one, and then it is too late.
      if (!both_ends || !v.near_high) average_overhang(low, v.low.index());
      slab_.vertices[id++] = v;
    });
    return id;
  }

  IsoSlab& slab_;
  BlockCache& cache_;
};

}  // namespace

void number_edges(Window& window, std::int32_t slab, const CornerRule& rule, IsoSlab* previous, IsoSlab& out) {
  out.slab = slab;
  out.triangles.clear();
  const std::vector<TileView> views = slab_tiles(window, slab);
  for_views<BlockParts<&CornerBlock::around, &CornerBlock::corners, &CornerBlock::outside, &CornerBlock::busy_layers>>(
      window, views, [](const TileView& tile, BlockCache&) { find_crossing(tile); });
  find_finer_busy(views, window);
  for_cheap_views(at_surface(views), [&](const TileView& tile) { mark_surface(tile, window); });
  // Again: a corner that a finer level holds may have been marked in a tile without edges.
  const std::vector<TileView> surface = at_surface(views);
  assign_numbers(window, surface, out);
  for_views<BlockParts<&CornerBlock::around, &CornerBlock::values, &CornerBlock::active, &CornerBlock::trusted,
                       &CornerBlock::seen, &CornerBlock::surface, &CornerBlock::numbers, &CornerBlock::creased,
                       &CornerBlock::shared>>(
      window, surface, [&](const TileView& tile, BlockCache&) { fill_corners(window, tile, rule, out); });
  for_views<BlockParts<&CornerBlock::around, &CornerBlock::accepted, &CornerBlock::numbers, &CornerBlock::cells,
                       &CornerBlock::surface>>(window, surface, [&](const TileView& tile, BlockCache& cache) {
    Numbering numbering(out, cache);
    const std::int32_t first = window.lattice().first_layer(tile.level, slab);
    numbering.fill_vertices(tile, first + window.lattice().layers(tile.level) - 1);
    if (previous != nullptr && tile.block.z * 8 + tile.begin == first) numbering.complete_below(tile, *previous);
  });
}

}  // namespace lamina
