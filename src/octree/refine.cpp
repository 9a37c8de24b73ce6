#include "octree/refine.h"

#include <tbb/combinable.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "base/floor_divide.h"
#include "lattice/bits.h"
#include "octree/finer_corner.h"

namespace lamina {
namespace {

/// Cells a sample reaches around its home. A radius is estimated too small by up to a fifth and a cell may be less than
/// half of it, so gaps between samples are up to five cells wide: with two, they came out as holes.
constexpr int kReachCells = 3;
/// Cells around the home that finer samples' cells inherit closeness from, and whose centres are projected.
constexpr int kCloseCells = 1;

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

/// Layers of a leaf that a slab covers.
struct LeafLayers {
  int begin, end;
};

LeafLayers leaf_layers(const Window& window, int level, std::int32_t slab, const Block& b) {
  const std::int32_t first = window.lattice().first_layer(level, slab) - b.z * 8;
  const int begin = first < 0 ? 0 : first;
  const int end = std::min(8, first + window.lattice().layers(level));
  return {begin, end};
}

template <typename Body>
void for_tiles(Window& window, int level, std::int32_t slab, const Body& body) {
  const Tiles tiles = window.tiles(level, slab);
  tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
    const LeafLayers layers = leaf_layers(window, level, slab, tiles[i].block);
    body(tiles[i], layers.begin, layers.end);
  });
}

/// The blocks around a tile that its marked cells, moved by up to [lo, hi]^3, come to lie in; `layers` has the layers
/// they may come to lie in.
void list_missing(const Tile& t, const BlockMask& m, std::pair<std::int32_t, std::int32_t> layers, int lo, int hi,
                  std::vector<Block>& missing) {
  std::array<std::uint64_t, 3> by_target{};  // layers that reach into the block below, this one, the one above
  for (int z = 0; z < 8; ++z) {
    if (m.words[z] == 0) continue;
    const std::int32_t layer = t.block.z * 8 + z;
    const std::int32_t from = std::max(layer + lo, layers.first);
    const std::int32_t to = std::min(layer + hi, layers.second - 1);
    if (from > to) continue;
    for (std::int32_t bz = from >> 3; bz <= (to >> 3); ++bz) by_target[bz - t.block.z + 1] |= m.words[z];
  }
  for (int dz = -1; dz <= 1; ++dz) {
    const std::uint64_t w = by_target[dz + 1];
    if (w == 0) continue;
    const bool left = lo < 0 && (w & bits::columns_below(-lo)) != 0;
    const bool right = hi > 0 && (w & ~bits::columns_below(8 - hi)) != 0;
    const bool down = lo < 0 && (w & ((std::uint64_t{1} << (8 * -lo)) - 1)) != 0;
    const bool up = hi > 0 && (w >> (8 * (8 - hi))) != 0;
    for (int dy = down ? -1 : 0; dy <= (up ? 1 : 0); ++dy) {
      for (int dx = left ? -1 : 0; dx <= (right ? 1 : 0); ++dx) {
        if (t.leaf->around[CornerBlock::towards(dx, dy, dz)] != nullptr) continue;
        missing.push_back({t.block.x + dx, t.block.y + dy, t.block.z + dz});
      }
    }
  }
}

/// Makes the blocks that the slab's part of the marked cells, moved by up to [lo, hi]^3, can fall into.
void touch_around(Window& window, int level, std::int32_t slab, BlockMask CornerBlock::*mask, int lo, int hi) {
  const Lattice& lattice = window.lattice();
  const std::int32_t first = lattice.first_layer(level, slab);
  const std::int32_t end = first + lattice.layers(level);
  const std::int32_t slab_lo = lattice.slab_of_layer(level, first - hi);
  const std::int32_t slab_hi = lattice.slab_of_layer(level, end - 1 - lo);
  tbb::combinable<std::vector<Block>> missing;
  std::int32_t done = std::numeric_limits<std::int32_t>::min();
  for (std::int32_t s = slab_lo; s <= slab_hi; ++s) {
    const Tiles tiles = window.tiles(level, s);
    tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
      const Tile& t = tiles[i];
      // Slabs share leaves at coarse levels.
      if (t.block.z > done) list_missing(t, t.leaf->*mask, {first, end}, lo, hi, missing.local());
    });
    done = (lattice.first_layer(level, s) + lattice.layers(level) - 1) >> 3;
  }
  // In any order: the window puts its tiles in order.
  missing.combine_each([&](const std::vector<Block>& blocks) {
    for (const Block& b : blocks) window.touch(level, b);
  });
}

Block parent_block(const Block& b) {
  return {b.x >> 1, b.y >> 1, b.z >> 1};
}

/// Word z of the child block's view of a parent mask.
std::uint64_t from_parent(const BlockMask& parent, const Block& child, int z) {
  return bits::spread_quarter(parent.words[(child.z & 1) * 4 + (z >> 1)], child.x & 1, child.y & 1);
}

void split_parents(Window& window, int level, std::int32_t slab) {
  Block last{};
  bool known = false;  // that `last` is there: neighbours mostly have the same parent
  for (const Tile& t : window.tiles(level, slab)) {
    const LeafLayers layers = leaf_layers(window, level, slab, t.block);
    const Block parent = parent_block(t.block);
    if (known && parent == last) continue;
    std::uint64_t any = 0;
    for (int z = layers.begin; z < layers.end; ++z) any |= t.leaf->touched.words[z] | t.leaf->split.words[z];
    if (any == 0) continue;
    window.touch(level + 1, parent);
    last = parent;
    known = true;
  }
  for_tiles(window, level + 1, slab, [&](const Tile& t, int begin, int end) {
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

/// Hands down of coarser samples down to the children of split cells.
void inherit(Window& window, int level, std::int32_t slab) {
  const int parent_level = level + 1;
  for (const Tile& t : window.tiles(parent_level, slab)) {
    const LeafLayers layers = leaf_layers(window, parent_level, slab, t.block);
    std::array<std::uint64_t, 2> nodes{};  // of the lower and of the upper half's layers, one above the other
    for (int z = layers.begin; z < layers.end; ++z) {
      nodes[z >> 2] |= t.leaf->split.words[z] & t.leaf->reached.words[z];
    }
    for (int octant = 0; octant < 8; ++octant) {
      const std::uint64_t quarter = std::uint64_t{0x0F0F0F0F} << (4 * (octant & 1) + 32 * ((octant >> 1) & 1));
      if ((nodes[octant >> 2] & quarter) == 0) continue;
      window.touch(level,
                   {t.block.x * 2 + (octant & 1), t.block.y * 2 + ((octant >> 1) & 1), t.block.z * 2 + (octant >> 2)});
    }
  }
  for_tiles(window, parent_level, slab, [&](const Tile& t, int begin, int end) {
    std::uint64_t split = 0;
    for (int z = begin; z < end; ++z) split |= t.leaf->split.words[z];
    if (split != 0) close_cells(*t.leaf, begin, end, &t.leaf->close.words[begin]);
  });
  for_tiles(window, level, slab, [&](const Tile& t, int begin, int end) {
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

/// Threads share words.
void set_bits(BlockMask& mask, int layer, std::uint64_t bits) {
  const std::atomic_ref<std::uint64_t> word(mask.words[static_cast<std::size_t>(layer)]);
  if ((word.load(std::memory_order_relaxed) & bits) != bits) word.fetch_or(bits, std::memory_order_relaxed);
}

typedef float Four __attribute__((vector_size(16)));             // NOLINT(modernize-use-using): attributes on typedefs
typedef std::int32_t FourInts __attribute__((vector_size(16)));  // NOLINT(modernize-use-using)
typedef std::int16_t FourRows __attribute__((vector_size(8)));   // NOLINT(modernize-use-using)

/// Four rows of 16 bits, from the lowest bits up.
using RowWord = std::uint64_t;

/// Of the 4^3 corners around a cell, from one below its low corner on, those less than `radius` from a point in the
/// cell (all in cells): rows of x, a word per layer.
std::array<RowWord, 4> corners_within(const std::array<float, 3>& point, float radius) {
  const auto squares = [](float at) {
    const Four d = Four{-1, 0, 1, 2} - at;
    return d * d;
  };
  const Four dx = squares(point[0]);
  const Four dy = squares(point[1]);
  const Four dz = squares(point[2]);
  std::array<RowWord, 4> out;
  for (int z = 0; z < 4; ++z) {
    const Four left = (radius * radius - dz[z]) - dy;  // a lane a row
    FourInts rows{};
    for (int x = 0; x < 4; ++x) rows |= (left > dx[x] + Four{}) & (1 << x);
    out[static_cast<std::size_t>(z)] = std::bit_cast<RowWord>(__builtin_convertvector(rows, FourRows));
  }
  return out;
}

/// Marks of one block's samples on their way into the window: without the other blocks' words and without other
/// threads.
class BlockMarks {
 public:
  void begin(int level, const Block& home) {
    level_ = level;
    home_ = home;
    cells_ = {};
    corners_ = {};
  }
  [[nodiscard]] bool holds(int level, const Block& home) const { return level == level_ && home == home_; }

  void mark_cell(int offset) { cells_[static_cast<std::size_t>(offset >> 6)] |= std::uint64_t{1} << (offset & 63); }
  /// The corners around a cell of the block, as of corners_within().
  void mark_corners(int offset, const std::array<RowWord, 4>& layers) {
    for (int k = 0; k < 4; ++k) {
      std::uint16_t* const rows =
          &corners_[static_cast<std::size_t>(((offset >> 6) + k) * kSide + ((offset >> 3) & 7))];
      RowWord four = 0;
      std::memcpy(&four, rows, sizeof(four));
      four |= layers[static_cast<std::size_t>(k)] << (offset & 7);
      std::memcpy(rows, &four, sizeof(four));
    }
  }

  void write_to(Window& window) const {
    if (level_ < 0) return;
    CornerBlock& here = window.touch_shared(level_, home_);
    for (int z = 0; z < 8; ++z) set_bits(here.home, z, cells_[static_cast<std::size_t>(z)]);
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) write_to(window, dx, dy, dz);
      }
    }
  }

 private:
  static constexpr int kSide = 12;  // from one corner below the block to three above its first beyond

  /// The part of the corners that lies in the block (dx, dy, dz) from the samples' own.
  void write_to(Window& window, int dx, int dy, int dz) const {
    CornerBlock* to = nullptr;
    for (int z = std::max(0, -1 - 8 * dz); z < std::min(8, kSide - 1 - 8 * dz); ++z) {
      std::uint64_t word = 0;
      for (int y = std::max(0, -1 - 8 * dy); y < std::min(8, kSide - 1 - 8 * dy); ++y) {
        const unsigned row = corners_[static_cast<std::size_t>((z + 8 * dz + 1) * kSide + y + 8 * dy + 1)];
        word |= std::uint64_t{(dx < 0 ? row << 7 : row >> (8 * dx + 1)) & 0xFFU} << (8 * y);
      }
      if (word == 0) continue;
      if (to == nullptr) to = &window.touch_shared(level_, {home_.x + dx, home_.y + dy, home_.z + dz});
      set_bits(to->acted_on, z, word);
    }
  }

  int level_ = -1;
  Block home_;
  std::array<std::uint64_t, 8> cells_{};
  /// [z + 1][y + 1], bit x + 1; four rows are marked at once.
  std::array<std::uint16_t, kSide * kSide> corners_{};
};

/// Takes over corners that a level holds which is finer by two or more, and none in between.
void share_across_levels(const Window& window, int level, const Tile& t, int begin, int end) {
  std::array<std::uint64_t, 8> beside{};
  bits::dilate_layers<0, 1>(gather(*t.leaf, &CornerBlock::split, 0), begin, end, &beside[begin]);
  for (int z = begin; z < end; ++z) {
    const std::uint64_t unshared = beside[z] & t.leaf->corners.words[z] & ~t.leaf->shared.words[z];
    for (std::uint64_t w = unshared; w != 0; w &= w - 1) {
      const int bit = std::countr_zero(w);
      const std::uint64_t one = w & (~w + 1);
      const FinerCorner finer =
          finer_corner(window, level, {t.block.x * 8 + (bit & 7), t.block.y * 8 + (bit >> 3), t.block.z * 8 + z});
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

void mark_samples(Window& window, std::span<const Mark> marks) {
  std::vector<FloorDivider> cells;  // by level
  cells.reserve(static_cast<std::size_t>(window.levels()));
  for (int level = 0; level < window.levels(); ++level) cells.emplace_back(window.lattice().cell_size(level));
  BlockMarks block;
  for (const Mark& m : marks) {
    const std::int32_t a = window.lattice().cell_size(m.level);
    const FloorDivider& cell_of = cells[m.level];
    const Cell cell{cell_of(m.x), cell_of(m.y), cell_of(m.z)};
    if (!block.holds(m.level, block_of(cell))) {
      block.write_to(window);
      block.begin(m.level, block_of(cell));
    }
    const float inv = 1.0F / static_cast<float>(a);
    const auto inside = [inv, a](std::int32_t v, std::int32_t low) {
      return static_cast<float>(std::int64_t{v} - std::int64_t{low} * a) * inv;
    };
    block.mark_cell(offset_in_block(cell));
    block.mark_corners(
        offset_in_block(cell),
        corners_within({inside(m.x, cell.x), inside(m.y, cell.y), inside(m.z, cell.z)}, m.active_radius * inv));
  }
  block.write_to(window);
}

void refine_slab(Window& window, std::int32_t slab) {
  const int levels = window.levels();
  for (int level = 0; level < levels; ++level) {
    touch_around(window, level, slab, &CornerBlock::home, -kReachCells, kReachCells);
    for_tiles(window, level, slab, [&](const Tile& t, int begin, int end) {
      const bits::Neighbourhood home = gather(*t.leaf, &CornerBlock::home, 1);
      bits::dilate_layers<-kReachCells, kReachCells>(home, begin, end, &t.leaf->touched.words[begin]);
    });
  }
  for (int level = 0; level + 1 < levels; ++level) split_parents(window, level, slab);
  for_tiles(window, levels - 1, slab, [&](const Tile& t, int begin, int end) {
    for (int z = begin; z < end; ++z) {
      t.leaf->reached.words[z] = t.leaf->touched.words[z];
      t.leaf->cells.words[z] = t.leaf->touched.words[z] & ~t.leaf->split.words[z];
    }
  });
  for (int level = levels - 2; level >= 0; --level) inherit(window, level, slab);
}

void place_corners(Window& window, std::int32_t slab) {
  for (int level = 0; level < window.levels(); ++level) {
    touch_around(window, level, slab, &CornerBlock::cells, 0, 1);
    for_tiles(window, level, slab, [&](const Tile& t, int begin, int end) {
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
    for_tiles(window, level, slab, [&](const Tile& t, int begin, int end) {
      for (int octant = 0; octant < 8; ++octant) {
        const int oz = (octant >> 2) * 4;
        if (oz >= end || oz + 4 <= begin) continue;
        const CornerBlock* child = std::as_const(window).probe(
            level - 1,
            {t.block.x * 2 + (octant & 1), t.block.y * 2 + ((octant >> 1) & 1), t.block.z * 2 + (octant >> 2)});
        if (child == nullptr) continue;
        for (int z = std::max(begin, oz); z < std::min(end, oz + 4); ++z) {
          const int cz = (z - oz) * 2;
          const std::uint64_t shared =
              bits::even_quarter(child->corners.words[cz], octant & 1, (octant >> 1) & 1) & t.leaf->corners.words[z];
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
