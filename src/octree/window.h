// The sliding window: one OpenVDB tree per level, filled and retired slab by slab; corners that several levels hold,
// and random access for the few places that leave their tile.
#pragma once
#include <tbb/partitioner.h>

#include <algorithm>
#include <array>
#include <bit>
#include <compare>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "lattice/lattice.h"
#include "octree/corner_block.h"

namespace lamina {

/// Coordinates of an 8^3 block at its level: cell coordinates divided by eight, rounded down.
struct Block {
  std::int32_t x = 0, y = 0, z = 0;
  auto operator<=>(const Block&) const = default;
};

constexpr Block block_of(const Cell& c) {
  return {c.x >> 3, c.y >> 3, c.z >> 3};
}
constexpr int offset_in_block(const Cell& c) {
  return BlockMask::offset(c.x & 7, c.y & 7, c.z & 7);
}

/// A leaf together with where it is; what stages iterate over.
struct Tile {
  Block block;
  CornerBlock* leaf = nullptr;
};

/// Tiles of a slab in canonical order (z, y, x): a view of the window's own list where one layer of leaves holds them
/// all, as it nearly always does. Valid until a leaf of the level is added or removed.
class Tiles : public std::span<const Tile> {
 public:
  explicit Tiles(std::span<const Tile> layer) : std::span<const Tile>(layer) {}
  explicit Tiles(std::vector<Tile> joined) : std::span<const Tile>(joined), joined_(std::move(joined)) {}
  Tiles(const Tiles&) = delete;
  Tiles& operator=(const Tiles&) = delete;

 private:
  std::vector<Tile> joined_;
};

/// At the i-th tile, for a later one; `Parts`: those of its block that the stage looks at.
template <typename Parts>
[[gnu::always_inline]] inline void ask_ahead(std::span<const Tile> tiles, std::size_t i) {
  if (i + kAskedAhead < tiles.size()) Parts::ask_for(*tiles[i + kAskedAhead].leaf);
}

class Window {
 public:
  /// `bounds`: where leaves are expected across the sweep axis; lookups inside take a table instead of the tree.
  /// `rare`: records have the rare channels (Channel).
  Window(const Lattice& lattice, int attributes, const Bounds& bounds = {}, bool rare = true);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  [[nodiscard]] const Lattice& lattice() const { return lattice_; }
  [[nodiscard]] int levels() const { return lattice_.levels; }
  [[nodiscard]] int attributes() const { return attributes_; }
  [[nodiscard]] bool has_rare() const { return rare_; }
  /// Where a channel lies in a record; attributes come behind the last one there is.
  [[nodiscard]] int place_of(int channel) const {
    return channel < kFirstAttribute || rare_ ? channel : channel - kFirstAttribute + kLean;
  }
  [[nodiscard]] int first_attribute() const { return place_of(kFirstAttribute); }
  [[nodiscard]] int channels() const { return first_attribute() + attributes_; }
  /// Layers of a slab inside one leaf of a level (1..8), and the leaf layers [first, first + n) a slab covers there.
  [[nodiscard]] int slab_layers(int level) const { return lattice_.layers(level) < 8 ? lattice_.layers(level) : 8; }
  [[nodiscard]] int slab_in_leaf(int level, int leaf_layer) const {
    return leaf_layer >> std::countr_zero(static_cast<unsigned>(slab_layers(level)));
  }

  /// Null where there is none. Safe from several threads while no leaf is added or removed.
  [[nodiscard]] const CornerBlock* probe(int level, const Block& b) const;
  [[nodiscard]] CornerBlock* probe(int level, const Block& b);
  /// The leaf, made if absent. One thread at a time.
  CornerBlock& touch(int level, const Block& b);
  /// Makes room for the leaves of a slab, before touch_shared() there.
  void cover(std::int32_t slab);
  /// touch() from several threads at once (all of them through this function, nobody probing), in covered slabs. Leaves
  /// that are made so have no neighbours (CornerBlock::around), nor are they anyone's, until introduce().
  CornerBlock& touch_shared(int level, const Block& b);
  /// Gives the leaves made by touch_shared() their neighbours, by all threads.
  void introduce();
  /// The level's leaves that hold layers of a slab. One thread at a time.
  [[nodiscard]] Tiles tiles(int level, std::int32_t slab) const;
  /// Frees the values of a slab's corners; masks stay.
  void retire_values(std::int32_t slab);
  /// Frees every leaf whose last layer lies below the slab.
  void retire_below(std::int32_t slab);
  /// Loops with much to do for each of a slab's tiles go by it: those at one place go to the same thread while all have
  /// work, as what it wrote of them is in its core's cache. Not for two loops at once.
  [[nodiscard]] tbb::affinity_partitioner& affinity() const { return affinity_; }
  [[nodiscard]] std::size_t leaf_count() const;
  [[nodiscard]] std::size_t memory() const;  ///< bytes held by nodes, values and retired leaves kept for reuse

 private:
  struct Trees;  // keeps openvdb.h out of this header

  Lattice lattice_;
  int attributes_;
  bool rare_;
  mutable tbb::affinity_partitioner affinity_;
  std::unique_ptr<Trees> trees_;
};

/// Layers [begin, end) of a leaf that a slab covers.
struct LeafLayers {
  int begin, end;
};
inline LeafLayers leaf_layers(const Window& window, int level, std::int32_t slab, const Block& b) {
  const std::int32_t first = window.lattice().first_layer(level, slab) - b.z * 8;
  return {std::max(first, 0), std::min(8, first + window.lattice().layers(level))};
}

/// A corner that several levels hold, in a finer one of them.
struct FinerCorner {
  int level;
  Cell corner;
  const CornerBlock* block;
  int offset;
};

/// In the next finer level that holds the corner; the block is null where none does. Levels in between need not hold
/// it: a leaf cell may lie beside one that is subdivided twice there.
FinerCorner finer_corner(const Window& window, int level, Cell corner);
/// The same for the tile's corner at `bit` of layer z.
inline FinerCorner finer_corner(const Window& window, int level, const Tile& tile, int z, int bit) {
  return finer_corner(window, level,
                      {tile.block.x * 8 + (bit & 7), tile.block.y * 8 + (bit >> 3), tile.block.z * 8 + z});
}

/// Remembers the blocks met last. One thread's; the window must not gain or lose leaves while it is in use.
class BlockCache {
 public:
  explicit BlockCache(const Window& window) : window_(&window) {}

  [[nodiscard]] const CornerBlock* block(int level, const Cell& c) {
    const Block b = block_of(c);
    // Neighbouring blocks differ in a parity, so a walk around a corner keeps all of its eight blocks.
    Entry& e = entries_[static_cast<std::size_t>(level & 15) * 8 + (b.x & 1) + 2 * (b.y & 1) + 4 * (b.z & 1)];
    if (!e.known || e.block != b) e = {b, window_->probe(level, b), true};
    return e.leaf;
  }
  [[nodiscard]] bool test(int level, const Cell& c, BlockMask CornerBlock::*mask) {
    const CornerBlock* b = block(level, c);
    return b != nullptr && (b->*mask).test(offset_in_block(c));
  }
  [[nodiscard]] const Window& window() const { return *window_; }

 private:
  struct Entry {
    Block block;
    const CornerBlock* leaf = nullptr;
    bool known = false;
  };
  const Window* window_;
  std::array<Entry, 128> entries_{};
};

}  // namespace lamina
