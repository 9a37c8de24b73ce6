#include "octree/refine.h"

#include <tbb/blocked_range.h>
#include <tbb/combinable.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <utility>
#include <vector>

#include "lattice/morphology.h"
#include "octree/slab_tiles.h"

namespace lamina {
namespace {

bits::Neighbourhood gather(const CornerBlock& leaf, BlockMask CornerBlock::*mask, int hi) {
  bits::Neighbourhood n{};
  for (int z = -1; z <= hi; ++z) {
    for (int y = -1; y <= hi; ++y) {
      for (int x = -1; x <= hi; ++x) {
        const CornerBlock* block = leaf.around[CornerBlock::towards(x, y, z)];
        n[z + 1][y + 1][x + 1] = block == nullptr ? nullptr : &(block->*mask);
      }
    }
  }
  return n;
}

/// Calls body(tile) for all of the tiles, by all threads, which looks at `Parts` of their blocks.
template <typename Parts, typename Body>
void for_tiles(std::span<const TileView> tiles, const Body& body) {
  constexpr std::size_t kAtOnce = 16;  // there is little to do for each
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, tiles.size(), kAtOnce), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      ask_ahead<Parts>(tiles, i);
      body(tiles[i]);
    }
  });
}

std::vector<TileView> tiles_of_level(const Window& window, int level, std::int32_t slab) {
  std::vector<TileView> tiles;
  add_tiles(window, level, slab, tiles);
  return tiles;
}

/// Which of the three blocks along an axis the marks of a word come to lie in, a bit each: those at `low` move below
/// the first, those at `high` above the last.
unsigned spread_of(std::uint64_t w, std::uint64_t low, std::uint64_t high) {
  return static_cast<unsigned>((w & low) != 0) | 2U | static_cast<unsigned>((w & high) != 0) << 2;
}

/// A block to be made.
struct NewBlock {
  int level;
  Block block;
};

/// As threads find them.
using Missing = tbb::combinable<std::vector<NewBlock>>;

/// The blocks around a tile that its marked cells, moved by up to [lo, hi]^3, come to lie in; `layers` has the layers
/// they may come to lie in.
void list_missing(const TileView& t, const BlockMask& m, std::pair<std::int32_t, std::int32_t> layers, int lo, int hi,
                  Missing& missing) {
  // Without branches but for what is missing, which little is: where marks lie is as good as random.
  std::uint32_t wanted = 0;  // as in CornerBlock::around
  for (int dz = -1; dz <= 1; ++dz) {
    const std::int32_t first = std::max(8 * dz, layers.first - t.block.z * 8);
    const std::int32_t last = std::min(8 * dz + 8, layers.second - t.block.z * 8) - 1;
    if (first > last) continue;
    std::uint64_t w = 0;
    for (int z = std::max(0, first - hi); z <= std::min(7, last - lo); ++z) w |= m.words[z];
    const unsigned x = spread_of(w, bits::columns_below(-lo), ~bits::columns_below(8 - hi));
    const unsigned y = spread_of(w, bits::rows_below(-lo), ~bits::rows_below(8 - hi));
    const std::uint32_t across = x * ((y & 1) | (y & 2) << 2 | (y & 4) << 4);
    wanted |= (w != 0 ? across : 0) << (9 * (dz + 1));
  }
  constexpr std::uint32_t kItself = 1U << 13;
  if ((wanted & ~kItself) == 0) return;
  std::uint32_t absent = 0;
  for (int i = 0; i < 27; ++i) absent |= static_cast<std::uint32_t>(t.leaf().around[i] == nullptr) << i;
  for (std::uint32_t left = wanted & absent; left != 0; left &= left - 1) {
    const int i = std::countr_zero(left);
    missing.local().push_back({t.level, {t.block.x + i % 3 - 1, t.block.y + i / 3 % 3 - 1, t.block.z + i / 9 - 1}});
  }
}

/// In any order: the window puts its tiles in order.
void make_blocks(Window& window, Missing& missing) {
  missing.combine_each([&](const std::vector<NewBlock>& blocks) {
    for (const NewBlock& b : blocks) window.touch_shared(b.level, b.block);
  });
  window.introduce();
}

/// The layers [first, second) of a slab at a level.
std::pair<std::int32_t, std::int32_t> layers_of(const Lattice& lattice, int level, std::int32_t slab) {
  const std::int32_t first = lattice.first_layer(level, slab);
  return {first, first + lattice.layers(level)};
}

/// Makes the blocks that the slab's part of the marked cells, moved by up to [lo, hi]^3, can fall into.
template <auto kMask>
void touch_around(Window& window, std::int32_t slab, int lo, int hi) {
  const Lattice& lattice = window.lattice();
  std::vector<TileView> tiles;
  for (int level = 0; level < window.levels(); ++level) {
    const auto [first, end] = layers_of(lattice, level, slab);
    std::int32_t done = std::numeric_limits<std::int32_t>::min();
    for (std::int32_t s = lattice.slab_of_layer(level, first - hi); s <= lattice.slab_of_layer(level, end - 1 - lo);
         ++s) {
      const std::size_t known = tiles.size();
      add_tiles(window, level, s, tiles);
      // Slabs share leaves at coarse levels.
      const auto again = std::find_if(tiles.begin() + static_cast<std::ptrdiff_t>(known), tiles.end(),
                                      [done](const TileView& t) { return t.block.z > done; });
      tiles.erase(tiles.begin() + static_cast<std::ptrdiff_t>(known), again);
      done = (layers_of(lattice, level, s).second - 1) >> 3;
    }
  }
  Missing missing;
  for_tiles<BlockParts<&CornerBlock::around, kMask>>(tiles, [&](const TileView& t) {
    list_missing(t, t.leaf().*kMask, layers_of(lattice, t.level, slab), lo, hi, missing);
  });
  make_blocks(window, missing);
}

Block parent_block(const Block& b) {
  return {b.x >> 1, b.y >> 1, b.z >> 1};
}

/// Word z of the child block's view of a parent mask.
std::uint64_t from_parent(const BlockMask& parent, const Block& child, int z) {
  return bits::spread_quarter(parent.words[(child.z & 1) * 4 + (z >> 1)], child.x & 1, child.y & 1);
}

/// Touches the cells around samples and makes the blocks of the cells above, which they split.
void touch_cells(Window& window, std::int32_t slab) {
  Missing parents;
  for_tiles<BlockParts<&CornerBlock::around, &CornerBlock::home, &CornerBlock::touched>>(
      slab_tiles(window, slab), [&](const TileView& t) {
        CornerBlock& leaf = t.leaf();
        const bits::Neighbourhood home = gather(leaf, &CornerBlock::home, 1);
        bits::dilate_layers<-kRefinedCells, kRefinedCells>(home, t.begin, t.end, &leaf.touched.words[t.begin]);
        std::uint64_t any = 0;
        for (int z = t.begin; z < t.end; ++z) any |= leaf.touched.words[z];
        if (any == 0) return;
        Block above = t.block;
        for (int level = t.level + 1; level < window.levels(); ++level) {
          above = parent_block(above);
          if (std::as_const(window).probe(level, above) == nullptr) parents.local().push_back({level, above});
        }
      });
  make_blocks(window, parents);
}

/// Splits the level's cells that have touched or split ones below them.
void split_cells(Window& window, int level, std::int32_t slab) {
  for_tiles<BlockParts<&CornerBlock::split>>(tiles_of_level(window, level, slab), [&](const TileView& t) {
    for (int octant = 0; octant < 8; ++octant) {
      const int ox = octant & 1;
      const int oy = (octant >> 1) & 1;
      const int oz = octant >> 2;
      if (oz * 4 >= t.end || oz * 4 + 4 <= t.begin) continue;
      const CornerBlock* child =
          std::as_const(window).probe(level - 1, {t.block.x * 2 + ox, t.block.y * 2 + oy, t.block.z * 2 + oz});
      if (child == nullptr) continue;
      for (int z = std::max(t.begin, oz * 4); z < std::min(t.end, oz * 4 + 4); ++z) {
        const int cz = (z - oz * 4) * 2;
        const std::uint64_t w = child->touched.words[cz] | child->touched.words[cz + 1] | child->split.words[cz] |
                                child->split.words[cz + 1];
        t.leaf().split.words[z] |= bits::even_quarter(bits::fold_pairs(w), ox, oy);
      }
    }
  });
}

/// What coarser samples reach of the tile's cells, and where they are close.
void take_from_parent(const CornerBlock* parent, const TileView& t) {
  CornerBlock& leaf = t.leaf();
  std::uint64_t any_above = 0;
  for (int z = t.begin; z < t.end; ++z) {
    const std::uint64_t nodes = parent == nullptr ? 0 : from_parent(parent->split, t.block, z);
    std::uint64_t reached = leaf.touched.words[z];
    if (parent != nullptr) {
      reached |= from_parent(parent->reached, t.block, z);
      leaf.above.words[z] = from_parent(parent->close, t.block, z) & nodes;
      any_above |= leaf.above.words[z];
    }
    leaf.reached.words[z] = reached & nodes;
    leaf.cells.words[z] = reached & nodes & ~leaf.split.words[z];
  }
  leaf.inherits = leaf.inherits || any_above != 0;
}

/// What a tile's children will ask for; lists the missing ones.
void provide_for_children(const Window& window, const TileView& t, Missing& missing) {
  CornerBlock& leaf = t.leaf();
  std::uint64_t split = 0;
  std::array<std::uint64_t, 2> nodes{};  // of the lower and of the upper half's layers, one above the other
  for (int z = t.begin; z < t.end; ++z) {
    split |= leaf.split.words[z];
    nodes[z >> 2] |= leaf.split.words[z] & leaf.reached.words[z];
  }
  if (split == 0) return;
  close_cells(leaf, t.begin, t.end, &leaf.close.words[t.begin]);
  for (int octant = 0; octant < 8; ++octant) {
    const std::uint64_t quarter = std::uint64_t{0x0F0F0F0F} << (4 * (octant & 1) + 32 * ((octant >> 1) & 1));
    if ((nodes[octant >> 2] & quarter) == 0) continue;
    const Block child{t.block.x * 2 + (octant & 1), t.block.y * 2 + ((octant >> 1) & 1), t.block.z * 2 + (octant >> 2)};
    if (window.probe(t.level - 1, child) == nullptr) missing.local().push_back({t.level - 1, child});
  }
}

/// Hands what samples reach down, from the coarsest level to the finest.
void hand_down(Window& window, std::int32_t slab) {
  const int top = window.levels() - 1;
  for (int level = top; level >= 0; --level) {
    Missing children;
    for_tiles<BlockParts<&CornerBlock::touched, &CornerBlock::reached, &CornerBlock::split, &CornerBlock::cells,
                         &CornerBlock::above>>(tiles_of_level(window, level, slab), [&](const TileView& t) {
      if (level < top) {
        take_from_parent(std::as_const(window).probe(level + 1, parent_block(t.block)), t);
      } else {
        for (int z = t.begin; z < t.end; ++z) {
          t.leaf().reached.words[z] = t.leaf().touched.words[z];
          t.leaf().cells.words[z] = t.leaf().touched.words[z] & ~t.leaf().split.words[z];
        }
      }
      if (level > 0) provide_for_children(window, t, children);
    });
    make_blocks(window, children);
  }
}

/// Whether cells of coarser samples' closeness touch the block's corners.
bool inherits(const CornerBlock& leaf) {
  for (int i = 0; i < 8; ++i) {
    const CornerBlock* const block = leaf.around[CornerBlock::towards(-(i & 1), -((i >> 1) & 1), -(i >> 2))];
    if (block != nullptr && block->inherits) return true;
  }
  return false;
}

/// Takes over corners that a level holds which is finer by two or more, and none in between.
void share_across_levels(const Window& window, const TileView& t) {
  CornerBlock& leaf = t.leaf();
  std::array<std::uint64_t, 8> beside{};
  bits::dilate_layers<0, 1>(gather(leaf, &CornerBlock::split, 0), t.begin, t.end, &beside[t.begin]);
  for (int z = t.begin; z < t.end; ++z) {
    const std::uint64_t unshared = beside[z] & leaf.corners.words[z] & ~leaf.shared.words[z];
    for (std::uint64_t w = unshared; w != 0; w &= w - 1) {
      const std::uint64_t one = w & (~w + 1);
      const FinerCorner finer = finer_corner(window, t.level, t.cell(z * 64 + std::countr_zero(w)));
      if (finer.block == nullptr) continue;
      leaf.shared.words[z] |= one;
      leaf.active.words[z] &= ~one;
      if (finer.block->active.test(finer.offset)) leaf.active.words[z] |= one;
    }
  }
}

/// A corner that the next finer level holds too is projected there; what it is there it is here.
void share_with_children(const Window& window, const TileView& t) {
  CornerBlock& leaf = t.leaf();
  for (int octant = 0; octant < 8; ++octant) {
    const int ox = octant & 1;
    const int oy = (octant >> 1) & 1;
    const int oz = (octant >> 2) * 4;
    if (oz >= t.end || oz + 4 <= t.begin) continue;
    const CornerBlock* child =
        window.probe(t.level - 1, {t.block.x * 2 + ox, t.block.y * 2 + oy, t.block.z * 2 + (octant >> 2)});
    if (child == nullptr) continue;
    for (int z = std::max(t.begin, oz); z < std::min(t.end, oz + 4); ++z) {
      const int cz = (z - oz) * 2;
      const std::uint64_t shared = bits::even_quarter(child->corners.words[cz], ox, oy) & leaf.corners.words[z];
      const std::uint64_t active = bits::even_quarter(child->active.words[cz], ox, oy);
      leaf.shared.words[z] |= shared;
      leaf.active.words[z] = (leaf.active.words[z] & ~shared) | (active & shared);
    }
  }
}

/// Corners of the tile's cells, and which of them have something to project.
void find_corners(const TileView& t) {
  CornerBlock& leaf = t.leaf();
  const bits::Neighbourhood cells = gather(leaf, &CornerBlock::cells, 0);
  bits::dilate_layers<0, 1>(cells, t.begin, t.end, &leaf.corners.words[t.begin]);
  std::copy_n(&leaf.acted_on.words[t.begin], t.end - t.begin, &leaf.active.words[t.begin]);
  if (inherits(leaf)) {
    std::array<std::uint64_t, 8> above{};
    bits::dilate_layers<0, 1>(gather(leaf, &CornerBlock::above, 0), t.begin, t.end, above.data());
    for (int z = t.begin; z < t.end; ++z) leaf.active.words[z] |= above[z - t.begin];
  }
  for (int z = t.begin; z < t.end; ++z) leaf.active.words[z] &= leaf.corners.words[z];
}

}  // namespace

void close_cells(const CornerBlock& leaf, int begin, int end, std::uint64_t* out) {
  bits::dilate_layers<-kCloseCells, kCloseCells>(gather(leaf, &CornerBlock::home, 1), begin, end, out);
  for (int z = begin; z < end; ++z) out[z - begin] |= leaf.above.words[z];
}

void refine_slab(Window& window, std::int32_t slab) {
  window.introduce();  // the blocks of samples marked since
  touch_around<&CornerBlock::home>(window, slab, -kRefinedCells, kRefinedCells);
  touch_cells(window, slab);
  for (int level = 1; level < window.levels(); ++level) split_cells(window, level, slab);
  hand_down(window, slab);
}

void place_corners(Window& window, std::int32_t slab) {
  touch_around<&CornerBlock::cells>(window, slab, 0, 1);
  for_tiles<BlockParts<&CornerBlock::around, &CornerBlock::cells, &CornerBlock::corners, &CornerBlock::acted_on,
                       &CornerBlock::active>>(slab_tiles(window, slab), find_corners);
  for (int level = 1; level < window.levels(); ++level) {
    for_tiles<BlockParts<&CornerBlock::corners, &CornerBlock::shared, &CornerBlock::active>>(
        tiles_of_level(window, level, slab), [&](const TileView& t) {
          share_with_children(window, t);
          if (level > 1) share_across_levels(window, t);
        });
  }
}

std::uint64_t count_cells(const Window& window, int level, std::int32_t slab) {
  std::uint64_t n = 0;
  for (const Tile& t : window.tiles(level, slab)) {
    const LeafLayers layers = leaf_layers(window, level, slab, t.block);
    for (int z = layers.begin; z < layers.end; ++z)
      n += static_cast<std::uint64_t>(std::popcount(t.leaf->cells.words[z]));
  }
  return n;
}

}  // namespace lamina
