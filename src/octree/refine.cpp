#include "octree/refine.h"

#include <tbb/combinable.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <utility>
#include <vector>

#include "lattice/morphology.h"
#include "octree/window.h"

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

/// Calls body(tile, begin, end) for the slab's layers [begin, end) of all tiles, which looks at `Parts` of their
/// blocks.
template <typename Parts, typename Body>
void for_tiles(Window& window, int level, std::int32_t slab, const Body& body) {
  const Tiles tiles = window.tiles(level, slab);
  tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
    ask_ahead<Parts>(tiles, i);
    const LeafLayers layers = leaf_layers(window, level, slab, tiles[i].block);
    body(tiles[i], layers.begin, layers.end);
  });
}

/// Which of the three blocks along an axis the marks of a word come to lie in, a bit each: those at `low` move below
/// the first, those at `high` above the last.
unsigned spread_of(std::uint64_t w, std::uint64_t low, std::uint64_t high) {
  return static_cast<unsigned>((w & low) != 0) | 2U | static_cast<unsigned>((w & high) != 0) << 2;
}

/// The blocks around a tile that its marked cells, moved by up to [lo, hi]^3, come to lie in; `layers` has the layers
/// they may come to lie in.
void list_missing(const Tile& t, const BlockMask& m, std::pair<std::int32_t, std::int32_t> layers, int lo, int hi,
                  std::vector<Block>& missing) {
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
  for (int i = 0; i < 27; ++i) absent |= static_cast<std::uint32_t>(t.leaf->around[i] == nullptr) << i;
  for (std::uint32_t left = wanted & absent; left != 0; left &= left - 1) {
    const int i = std::countr_zero(left);
    missing.push_back({t.block.x + i % 3 - 1, t.block.y + i / 3 % 3 - 1, t.block.z + i / 9 - 1});
  }
}

/// Blocks to be made, as threads find them.
using Missing = tbb::combinable<std::vector<Block>>;

/// In any order: the window puts its tiles in order.
void make_blocks(Window& window, int level, Missing& missing) {
  missing.combine_each([&](const std::vector<Block>& blocks) {
    for (const Block& b : blocks) window.touch_shared(level, b);
  });
  window.introduce();
}

/// Makes the blocks that the slab's part of the marked cells, moved by up to [lo, hi]^3, can fall into.
template <auto kMask>
void touch_around(Window& window, int level, std::int32_t slab, int lo, int hi) {
  const Lattice& lattice = window.lattice();
  const std::int32_t first = lattice.first_layer(level, slab);
  const std::int32_t end = first + lattice.layers(level);
  const std::int32_t slab_lo = lattice.slab_of_layer(level, first - hi);
  const std::int32_t slab_hi = lattice.slab_of_layer(level, end - 1 - lo);
  Missing missing;
  std::int32_t done = std::numeric_limits<std::int32_t>::min();
  for (std::int32_t s = slab_lo; s <= slab_hi; ++s) {
    const Tiles tiles = window.tiles(level, s);
    tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
      ask_ahead<BlockParts<&CornerBlock::around, kMask>>(tiles, i);
      const Tile& t = tiles[i];
      // Slabs share leaves at coarse levels.
      if (t.block.z > done) list_missing(t, t.leaf->*kMask, {first, end}, lo, hi, missing.local());
    });
    done = (lattice.first_layer(level, s) + lattice.layers(level) - 1) >> 3;
  }
  make_blocks(window, level, missing);
}

Block parent_block(const Block& b) {
  return {b.x >> 1, b.y >> 1, b.z >> 1};
}

/// Word z of the child block's view of a parent mask.
std::uint64_t from_parent(const BlockMask& parent, const Block& child, int z) {
  return bits::spread_quarter(parent.words[(child.z & 1) * 4 + (z >> 1)], child.x & 1, child.y & 1);
}

void split_parents(Window& window, int level, std::int32_t slab) {
  Missing parents;
  for_tiles<BlockParts<&CornerBlock::touched, &CornerBlock::split>>(
      window, level, slab, [&](const Tile& t, int begin, int end) {
        std::uint64_t any = 0;
        for (int z = begin; z < end; ++z) any |= t.leaf->touched.words[z] | t.leaf->split.words[z];
        const Block parent = parent_block(t.block);
        if (any != 0 && std::as_const(window).probe(level + 1, parent) == nullptr) parents.local().push_back(parent);
      });
  make_blocks(window, level + 1, parents);
  for_tiles<BlockParts<&CornerBlock::split>>(window, level + 1, slab, [&](const Tile& t, int begin, int end) {
    for (int octant = 0; octant < 8; ++octant) {
      const int ox = octant & 1;
      const int oy = (octant >> 1) & 1;
      const int oz = octant >> 2;
      if (oz * 4 >= end || oz * 4 + 4 <= begin) continue;
      const CornerBlock* child =
          std::as_const(window).probe(level, {t.block.x * 2 + ox, t.block.y * 2 + oy, t.block.z * 2 + oz});
      if (child == nullptr) continue;
      for (int z = std::max(begin, oz * 4); z < std::min(end, oz * 4 + 4); ++z) {
        const int cz = (z - oz * 4) * 2;
        const std::uint64_t w = child->touched.words[cz] | child->touched.words[cz + 1] | child->split.words[cz] |
                                child->split.words[cz + 1];
        t.leaf->split.words[z] |= bits::even_quarter(bits::fold_pairs(w), ox, oy);
      }
    }
  });
}

/// Hands what coarser samples reach, and where they are close, down to the children of split cells.
void inherit(Window& window, int level, std::int32_t slab) {
  const int parent_level = level + 1;
  Missing children;
  for_tiles<BlockParts<&CornerBlock::split, &CornerBlock::reached>>(
      window, parent_level, slab, [&](const Tile& t, int begin, int end) {
        std::array<std::uint64_t, 2> nodes{};  // of the lower and of the upper half's layers, one above the other
        for (int z = begin; z < end; ++z) nodes[z >> 2] |= t.leaf->split.words[z] & t.leaf->reached.words[z];
        for (int octant = 0; octant < 8; ++octant) {
          const std::uint64_t quarter = std::uint64_t{0x0F0F0F0F} << (4 * (octant & 1) + 32 * ((octant >> 1) & 1));
          if ((nodes[octant >> 2] & quarter) == 0) continue;
          const Block child{t.block.x * 2 + (octant & 1), t.block.y * 2 + ((octant >> 1) & 1),
                            t.block.z * 2 + (octant >> 2)};
          if (std::as_const(window).probe(level, child) == nullptr) children.local().push_back(child);
        }
      });
  make_blocks(window, level, children);
  for_tiles<BlockParts<&CornerBlock::split, &CornerBlock::home, &CornerBlock::around, &CornerBlock::close>>(
      window, parent_level, slab, [&](const Tile& t, int begin, int end) {
        std::uint64_t split = 0;
        for (int z = begin; z < end; ++z) split |= t.leaf->split.words[z];
        if (split != 0) close_cells(*t.leaf, begin, end, &t.leaf->close.words[begin]);
      });
  for_tiles<BlockParts<&CornerBlock::touched, &CornerBlock::reached, &CornerBlock::split, &CornerBlock::cells,
                       &CornerBlock::above>>(window, level, slab, [&](const Tile& t, int begin, int end) {
    const CornerBlock* parent = std::as_const(window).probe(parent_level, parent_block(t.block));
    std::uint64_t any_above = 0;
    for (int z = begin; z < end; ++z) {
      const std::uint64_t nodes = parent == nullptr ? 0 : from_parent(parent->split, t.block, z);
      std::uint64_t reached = t.leaf->touched.words[z];
      if (parent != nullptr) {
        reached |= from_parent(parent->reached, t.block, z);
        t.leaf->above.words[z] = from_parent(parent->close, t.block, z) & nodes;
        any_above |= t.leaf->above.words[z];
      }
      t.leaf->reached.words[z] = reached & nodes;
      t.leaf->cells.words[z] = reached & nodes & ~t.leaf->split.words[z];
    }
    t.leaf->inherits = t.leaf->inherits || any_above != 0;
  });
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
void share_across_levels(const Window& window, int level, const Tile& t, int begin, int end) {
  std::array<std::uint64_t, 8> beside{};
  bits::dilate_layers<0, 1>(gather(*t.leaf, &CornerBlock::split, 0), begin, end, &beside[begin]);
  for (int z = begin; z < end; ++z) {
    const std::uint64_t unshared = beside[z] & t.leaf->corners.words[z] & ~t.leaf->shared.words[z];
    for (std::uint64_t w = unshared; w != 0; w &= w - 1) {
      const int bit = std::countr_zero(w);
      const std::uint64_t one = w & (~w + 1);
      const FinerCorner finer = finer_corner(window, level, t, z, bit);
      if (finer.block == nullptr) continue;
      t.leaf->shared.words[z] |= one;
      t.leaf->active.words[z] &= ~one;
      if (finer.block->active.test(finer.offset)) t.leaf->active.words[z] |= one;
    }
  }
}

}  // namespace

void close_cells(const CornerBlock& leaf, int begin, int end, std::uint64_t* out) {
  bits::dilate_layers<-kCloseCells, kCloseCells>(gather(leaf, &CornerBlock::home, 1), begin, end, out);
  for (int z = begin; z < end; ++z) out[z - begin] |= leaf.above.words[z];
}

void refine_slab(Window& window, std::int32_t slab) {
  const int levels = window.levels();
  window.introduce();  // the blocks of samples marked since
  for (int level = 0; level < levels; ++level) {
    touch_around<&CornerBlock::home>(window, level, slab, -kRefinedCells, kRefinedCells);
    for_tiles<BlockParts<&CornerBlock::around, &CornerBlock::home, &CornerBlock::touched>>(
        window, level, slab, [&](const Tile& t, int begin, int end) {
          const bits::Neighbourhood home = gather(*t.leaf, &CornerBlock::home, 1);
          bits::dilate_layers<-kRefinedCells, kRefinedCells>(home, begin, end, &t.leaf->touched.words[begin]);
        });
  }
  for (int level = 0; level + 1 < levels; ++level) split_parents(window, level, slab);
  for_tiles<BlockParts<&CornerBlock::touched, &CornerBlock::reached, &CornerBlock::split, &CornerBlock::cells>>(
      window, levels - 1, slab, [&](const Tile& t, int begin, int end) {
        for (int z = begin; z < end; ++z) {
          t.leaf->reached.words[z] = t.leaf->touched.words[z];
          t.leaf->cells.words[z] = t.leaf->touched.words[z] & ~t.leaf->split.words[z];
        }
      });
  for (int level = levels - 2; level >= 0; --level) inherit(window, level, slab);
}

void place_corners(Window& window, std::int32_t slab) {
  for (int level = 0; level < window.levels(); ++level) {
    touch_around<&CornerBlock::cells>(window, level, slab, 0, 1);
    for_tiles<BlockParts<&CornerBlock::around, &CornerBlock::cells, &CornerBlock::corners, &CornerBlock::acted_on,
                         &CornerBlock::active>>(window, level, slab, [&](const Tile& t, int begin, int end) {
      const bits::Neighbourhood cells = gather(*t.leaf, &CornerBlock::cells, 0);
      bits::dilate_layers<0, 1>(cells, begin, end, &t.leaf->corners.words[begin]);
      std::copy_n(&t.leaf->acted_on.words[begin], end - begin, &t.leaf->active.words[begin]);
      if (inherits(*t.leaf)) {
        std::array<std::uint64_t, 8> above{};
        bits::dilate_layers<0, 1>(gather(*t.leaf, &CornerBlock::above, 0), begin, end, above.data());
        for (int z = begin; z < end; ++z) t.leaf->active.words[z] |= above[z - begin];
      }
      for (int z = begin; z < end; ++z) t.leaf->active.words[z] &= t.leaf->corners.words[z];
    });
    if (level == 0) continue;
    // A corner that a finer level holds too is projected there; what it is there it is here.
    for_tiles<BlockParts<&CornerBlock::corners, &CornerBlock::shared, &CornerBlock::active>>(
        window, level, slab, [&](const Tile& t, int begin, int end) {
          for (int octant = 0; octant < 8; ++octant) {
            const int oz = (octant >> 2) * 4;
            if (oz >= end || oz + 4 <= begin) continue;
            const CornerBlock* child = std::as_const(window).probe(
                level - 1,
                {t.block.x * 2 + (octant & 1), t.block.y * 2 + ((octant >> 1) & 1), t.block.z * 2 + (octant >> 2)});
            if (child == nullptr) continue;
            for (int z = std::max(begin, oz); z < std::min(end, oz + 4); ++z) {
              const int cz = (z - oz) * 2;
              const std::uint64_t shared = bits::even_quarter(child->corners.words[cz], octant & 1, (octant >> 1) & 1) &
                                           t.leaf->corners.words[z];
              const std::uint64_t active = bits::even_quarter(child->active.words[cz], octant & 1, (octant >> 1) & 1);
              t.leaf->shared.words[z] |= shared;
              t.leaf->active.words[z] = (t.leaf->active.words[z] & ~shared) | (active & shared);
            }
          }
          if (level > 1) share_across_levels(window, level, t, begin, end);
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
