#include "octree/window.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/spin_mutex.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <limits>
#include <set>
#include <tuple>

#include "octree/corner_leaf.h"
#include "octree/layer_table.h"

namespace lamina {

namespace {

openvdb::Coord leaf_origin(const Block& b) {
  return {b.z * 8, b.y * 8, b.x * 8};
}

std::size_t value_bytes(const Projected& points) {
  std::size_t bytes = 0;
  for (const CornerValues& v : points.values) bytes += sizeof(float) * v.size();
  return bytes;
}

constexpr std::size_t kAtOnce = 64;  ///< leaves that a thread looks at with little to do for each

using Upper = CornerTree::RootNodeType::ChildNodeType;
using Lower = Upper::ChildNodeType;

/// Inner nodes that had leaves, by origin: in order of the sweep.
using Branches = std::set<openvdb::Coord>;

bool before(const Tile& a, const Tile& b) {
  return std::tie(a.block.y, a.block.x) < std::tie(b.block.y, b.block.x);
}

/// Removes the inner nodes that end at or below a layer of cells.
template <typename Node>
void retire_branches(CornerTree& tree, Branches& branches, std::int32_t end) {
  while (!branches.empty() && branches.begin()->x() + static_cast<std::int32_t>(Node::DIM) <= end) {
    delete tree.stealNode<Node>(*branches.begin(), false, false);
    branches.erase(branches.begin());
  }
}

}  // namespace

struct Window::Trees {
  /// The leaves of one layer of blocks: as a list, put in order when it is asked for, and by place for quick lookup.
  struct Layer {
    std::vector<Tile> tiles;
    std::size_t ordered = 0;  ///< so many of the tiles are in canonical order
    LayerTable table;
  };
  struct Level {
    CornerTree tree{false};
    std::deque<Layer> layers;  ///< block layers z_base, z_base + 1, ...
    std::int32_t z_base = 0;
    std::vector<Layer> spare;  ///< without leaves; tables for other layers
    Branches lower, upper;     ///< inner nodes with retired leaves
    TableExtent extent;        ///< of the layers' tables
  };
  explicit Trees(int count) : levels(static_cast<std::size_t>(count)) {}

  std::vector<Level> levels;
  std::vector<std::unique_ptr<CornerLeaf>> spare;  ///< retired leaves, used again: leaves come and go all the time
  SparePages spare_pages;
  tbb::spin_mutex creation;  ///< held for less than a thread takes to be woken
  /// A leaf that does not know its neighbours, nor they it.
  struct Stranger {
    int level;
    Tile tile;
  };
  std::vector<Stranger> strangers;

  /// The lookup table that knows of the block, null where none does.
  static LayerTable* table(Level& level, const Block& b) {
    const std::int32_t z = b.z - level.z_base;
    if (z < 0 || z >= static_cast<std::int32_t>(level.layers.size())) return nullptr;
    LayerTable& table = level.layers[z].table;
    return table.covers(b.x, b.y) ? &table : nullptr;
  }

  CornerBlock* find(int l, const Block& b) {
    Level& level = levels[l];
    if (const LayerTable* known = table(level, b)) return known->find(b.x, b.y);
    // Every leaf has its layer.
    if (b.z < level.z_base || b.z - level.z_base >= static_cast<std::int32_t>(level.layers.size())) return nullptr;
    CornerLeaf* leaf = level.tree.probeLeaf(leaf_origin(b));
    return leaf == nullptr ? nullptr : &leaf->block;
  }

  void cover(Level& level, std::int32_t z) {
    if (level.layers.empty()) level.z_base = z;
    const auto empty_layer = [&] {
      if (level.spare.empty()) return Layer{{}, 0, LayerTable(level.extent)};
      Layer layer = std::move(level.spare.back());
      level.spare.pop_back();
      return layer;
    };
    while (z < level.z_base) {
      level.layers.push_front(empty_layer());
      --level.z_base;
    }
    while (z >= level.z_base + static_cast<std::int32_t>(level.layers.size())) level.layers.push_back(empty_layer());
  }

  CornerBlock& create(int l, const Block& b) {
    Level& level = levels[l];
    cover(level, b.z);
    CornerLeaf* leaf = new_leaf(leaf_origin(b));
    level.tree.addLeaf(leaf);
    CornerBlock& block = leaf->block;
    level.layers[b.z - level.z_base].tiles.push_back({b, &block});
    strangers.push_back({l, {b, &block}});
    if (LayerTable* known = table(level, b)) known->set(b.x, b.y, &block, spare_pages);
    return block;
  }

  CornerLeaf* new_leaf(const openvdb::Coord& origin) {
    if (spare.empty()) return new CornerLeaf(origin);
    CornerLeaf* leaf = spare.back().release();
    spare.pop_back();
    leaf->setOrigin(origin);
    std::destroy_at(&leaf->block);
    std::construct_at(&leaf->block);
    return leaf;
  }

  void retire(Level& level, const Tile& t) {
    take_leave(*t.leaf);
    for (CornerValues& v : t.leaf->values) v = {};
    t.leaf->centres.reset();
    spare.emplace_back(level.tree.stealNode<CornerLeaf>(leaf_origin(t.block), false, false));
  }

  /// Stages look at a leaf's neighbours far more often than leaves come and go. Two strangers write the same.
  void introduce(const Stranger& stranger) {
    const auto& [b, block] = stranger.tile;
    const auto set = [](CornerBlock*& to, CornerBlock* other) {
      std::atomic_ref(to).store(other, std::memory_order_relaxed);
    };
    for (int dz = -1; dz <= 1; ++dz) {
      const std::array<CornerBlock*, 9> others = find_around(stranger.level, {b.x, b.y, b.z + dz});
      const int first = CornerBlock::towards(-1, -1, dz);
      for (int i = 0; i < 9; ++i) {
        if (others[i] == nullptr) continue;
        set(block->around[first + i], others[i]);
        set(others[i]->around[26 - first - i], block);
      }
    }
  }

  /// The block and the eight around it across the sweep axis, [y][x]; null where there is none.
  std::array<CornerBlock*, 9> find_around(int l, const Block& b) {
    Level& level = levels[l];
    const std::int32_t z = b.z - level.z_base;
    if (z < 0 || z >= static_cast<std::int32_t>(level.layers.size())) return {};  // every leaf has its layer
    if (const auto known = level.layers[z].table.find_around(b.x, b.y)) return *known;
    std::array<CornerBlock*, 9> out;
    for (int i = 0; i < 9; ++i) out[i] = find(l, {b.x + i % 3 - 1, b.y + i / 3 - 1, b.z});
    return out;
  }

  /// Of the neighbours only those above outlive a layer.
  static void take_leave(const CornerBlock& block) {
    for (int i = 18; i < 27; ++i) {
      if (block.around[i] != nullptr) block.around[i]->around[26 - i] = nullptr;
    }
  }

  /// Takes out the lowest layer. Its table is used again.
  void clear_front(Level& level) {
    Layer& empty = level.spare.emplace_back(std::move(level.layers.front()));
    empty.tiles.clear();
    empty.ordered = 0;
    empty.table.clear(spare_pages);
    level.layers.pop_front();
  }

  static std::span<const Tile> in_order(Layer& layer) {
    if (layer.ordered == layer.tiles.size()) return layer.tiles;
    const auto added = layer.tiles.begin() + static_cast<std::ptrdiff_t>(layer.ordered);
    std::sort(added, layer.tiles.end(), before);
    std::inplace_merge(layer.tiles.begin(), added, layer.tiles.end(), before);
    layer.ordered = layer.tiles.size();
    return layer.tiles;
  }
};

Window::Window(const Lattice& lattice, int attributes, const Bounds& bounds, bool rare)
    : lattice_(lattice), attributes_(attributes), rare_(rare), trees_(std::make_unique<Trees>(lattice.levels)) {
  for (int l = 0; l < lattice.levels; ++l) {
    Trees::Level& level = trees_->levels[l];
    // Cells reach 2^28 steps, eight of them more than an int; one block holds every bound then, whatever its end.
    const std::int32_t block = std::min(lattice.cell_size(l), std::numeric_limits<std::int32_t>::max() / 8) * 8;
    if (bounds.x_max < bounds.x_min) continue;
    TableExtent extent;
    extent.x0 = floor_div(bounds.x_min, block) - 1;
    extent.y0 = floor_div(bounds.y_min, block) - 1;
    extent.nx = floor_div(bounds.x_max, block) + 2 - extent.x0;
    extent.ny = floor_div(bounds.y_max, block) + 2 - extent.y0;
    if (extent.pages() <= kMostTablePages) level.extent = extent;
  }
}

Window::~Window() = default;

const CornerBlock* Window::probe(int level, const Block& b) const {
  return trees_->find(level, b);
}

CornerBlock* Window::probe(int level, const Block& b) {
  return trees_->find(level, b);
}

CornerBlock& Window::touch(int level, const Block& b) {
  if (CornerBlock* block = trees_->find(level, b)) return *block;
  CornerBlock& made = trees_->create(level, b);
  introduce();
  return made;
}

void Window::cover(std::int32_t slab) {
  for (int l = 0; l < levels(); ++l) {
    const std::int32_t first = lattice_.first_layer(l, slab);
    trees_->cover(trees_->levels[l], first >> 3);
    trees_->cover(trees_->levels[l], (first + lattice_.layers(l) - 1) >> 3);
  }
}

CornerBlock& Window::touch_shared(int level, const Block& b) {
  if (const LayerTable* table = Trees::table(trees_->levels[level], b)) {
    if (CornerBlock* block = table->find(b.x, b.y)) return *block;
  }
  const tbb::spin_mutex::scoped_lock lock(trees_->creation);
  CornerBlock* const there = trees_->find(level, b);
  return there != nullptr ? *there : trees_->create(level, b);
}

void Window::introduce() {
  const auto& strangers = trees_->strangers;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, strangers.size(), kAtOnce), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) trees_->introduce(strangers[i]);
  });
  trees_->strangers.clear();
}

Tiles Window::tiles(int level, std::int32_t slab) const {
  const std::int32_t first = lattice_.first_layer(level, slab);
  const std::int32_t last = first + lattice_.layers(level) - 1;
  Trees::Level& l = trees_->levels[level];
  const std::int32_t z_end = std::min(last >> 3, l.z_base + static_cast<std::int32_t>(l.layers.size()) - 1);
  const std::int32_t z_begin = std::max(first >> 3, l.z_base);
  if (z_begin > z_end) return Tiles(std::span<const Tile>{});
  if (z_begin == z_end) return Tiles(Trees::in_order(l.layers[z_begin - l.z_base]));
  std::vector<Tile> joined;
  for (std::int32_t z = z_begin; z <= z_end; ++z) {
    const std::span<const Tile> layer = Trees::in_order(l.layers[z - l.z_base]);
    joined.insert(joined.end(), layer.begin(), layer.end());
  }
  return Tiles(std::move(joined));
}

void Window::retire_values(std::int32_t slab) {
  for (int level = 0; level < levels(); ++level) {
    const int place = slab_in_leaf(level, lattice_.first_layer(level, slab) & 7);
    const Tiles of_slab = tiles(level, slab);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, of_slab.size(), kAtOnce), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) {
        CornerBlock& leaf = *of_slab[i].leaf;
        leaf.values[place] = {};
        if (leaf.centres != nullptr) leaf.centres->values[place] = {};
      }
    });
  }
}

void Window::retire_below(std::int32_t slab) {
  introduce();
  for (int l = 0; l < levels(); ++l) {
    Trees::Level& level = trees_->levels[l];
    const std::int32_t first = lattice_.first_layer(l, slab);
    while (!level.layers.empty() && level.z_base * 8 + 8 <= first) {
      openvdb::Coord last = openvdb::Coord::max();
      for (const Tile& t : level.layers.front().tiles) {
        const openvdb::Coord origin = leaf_origin(t.block);
        trees_->retire(level, t);
        const openvdb::Coord lower = origin & ~(static_cast<std::int32_t>(Lower::DIM) - 1);
        if (lower == last) continue;  // neighbours mostly share their inner nodes
        last = lower;
        level.lower.insert(lower);
        level.upper.insert(origin & ~(static_cast<std::int32_t>(Upper::DIM) - 1));
      }
      trees_->clear_front(level);
      ++level.z_base;
    }
    retire_branches<Lower>(level.tree, level.lower, first);
    const std::size_t before = level.upper.size();
    retire_branches<Upper>(level.tree, level.upper, first);
    if (level.upper.size() < before) level.tree.root().eraseBackgroundTiles();
  }
  // A slab behind the widest cross-section gives its memory back.
  const std::size_t used = leaf_count();
  if (trees_->spare.size() > used) trees_->spare.resize(used);
  if (trees_->spare_pages.size() > used) trees_->spare_pages.resize(used);
}

std::size_t Window::leaf_count() const {
  std::size_t n = 0;
  for (const auto& level : trees_->levels) {
    for (const auto& layer : level.layers) n += layer.tiles.size();
  }
  return n;
}

std::size_t Window::memory() const {
  std::size_t bytes = trees_->spare.size() * sizeof(CornerLeaf) + trees_->spare_pages.size() * sizeof(TablePage);
  for (const auto& level : trees_->levels) {
    const std::vector<openvdb::Index32> nodes = level.tree.nodeCount();
    bytes += nodes[Lower::LEVEL] * sizeof(Lower) + nodes[Upper::LEVEL] * sizeof(Upper);
    for (const auto& layer : level.layers) {
      bytes += layer.table.memory();
      for (const Tile& t : layer.tiles) {
        bytes += sizeof(CornerLeaf);
        bytes += value_bytes(*t.leaf);
        if (t.leaf->centres != nullptr) bytes += sizeof(Projected) + value_bytes(*t.leaf->centres);
      }
    }
  }
  return bytes;
}

FinerCorner finer_corner(const Window& window, int level, Cell corner) {
  while (level-- > 0) {
    corner = {corner.x * 2, corner.y * 2, corner.z * 2};
    const CornerBlock* block = window.probe(level, block_of(corner));
    const int offset = offset_in_block(corner);
    if (block != nullptr && block->corners.test(offset)) return {level, corner, block, offset};
  }
  return {-1, corner, nullptr, 0};
}

}  // namespace lamina
