// The sliding window: one OpenVDB tree per level, filled and retired slab by slab.
#pragma once
#include <compare>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "lattice/extent.h"
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

class Window {
 public:
  /// `bounds`: where leaves are expected across the sweep axis; lookups inside take a table instead of the tree.
  Window(const Lattice& lattice, int attributes, const Bounds& bounds = {});
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  [[nodiscard]] const Lattice& lattice() const { return lattice_; }
  [[nodiscard]] int levels() const { return lattice_.levels; }
  [[nodiscard]] int attributes() const { return attributes_; }
  [[nodiscard]] int channels() const { return kFirstAttribute + attributes_; }
  /// Layers of a slab inside one leaf of a level (1..8), and the leaf layers [first, first + n) a slab covers there.
  [[nodiscard]] int slab_layers(int level) const { return lattice_.layers(level) < 8 ? lattice_.layers(level) : 8; }
  [[nodiscard]] int slab_in_leaf(int level, int leaf_layer) const { return leaf_layer / slab_layers(level); }

  /// Null where there is none. Safe from several threads while no leaf is added or removed.
  [[nodiscard]] const CornerBlock* probe(int level, const Block& b) const;
  [[nodiscard]] CornerBlock* probe(int level, const Block& b);
  /// The leaf, made if absent. One thread at a time.
  CornerBlock& touch(int level, const Block& b);
  /// Makes room for the leaves of a slab, before touch_shared() there.
  void cover(std::int32_t slab);
  /// touch() from several threads at once (all of them through this function, nobody probing), in covered slabs.
  CornerBlock& touch_shared(int level, const Block& b);
  /// The level's leaves that hold layers of a slab. One thread at a time.
  [[nodiscard]] Tiles tiles(int level, std::int32_t slab) const;
  /// Frees the values of a slab's corners; masks stay.
  void retire_values(std::int32_t slab);
  /// Frees every leaf whose last layer lies below the slab.
  void retire_below(std::int32_t slab);
  [[nodiscard]] std::size_t leaf_count() const;
  [[nodiscard]] std::size_t memory() const;  ///< bytes held by nodes, values and retired leaves kept for reuse

 private:
  struct Trees;  // keeps openvdb.h out of this header

  Lattice lattice_;
  int attributes_;
  std::unique_ptr<Trees> trees_;
};

}  // namespace lamina
