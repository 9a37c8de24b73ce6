#include "window/window.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "window/corner_leaf.h"

namespace lamina {
namespace {

openvdb::Coord leaf_origin(const Block& b) {
  return {b.z * 8, b.y * 8, b.x * 8};
}

}  // namespace

struct Window::Trees {
  struct Level {
    CornerTree tree{false};
    std::map<std::int32_t, std::vector<Tile>> layers;  ///< by block layer z, in order of creation
  };
  std::vector<Level> levels;
};

Window::Window(const Lattice& lattice, int attributes)
    : lattice_(lattice), attributes_(attributes), trees_(std::make_unique<Trees>()) {
  trees_->levels.resize(static_cast<std::size_t>(lattice.levels));
}

Window::~Window() = default;

const CornerBlock* Window::probe(int level, const Block& b) const {
  const CornerLeaf* leaf = trees_->levels[level].tree.probeConstLeaf(leaf_origin(b));
  return leaf == nullptr ? nullptr : &leaf->block;
}

CornerBlock* Window::probe(int level, const Block& b) {
  CornerLeaf* leaf = trees_->levels[level].tree.probeLeaf(leaf_origin(b));
  return leaf == nullptr ? nullptr : &leaf->block;
}

CornerBlock& Window::touch(int level, const Block& b) {
  if (CornerBlock* block = probe(level, b)) return *block;
  auto& [tree, layers] = trees_->levels[level];
  CornerBlock& block = tree.touchLeaf(leaf_origin(b))->block;
  layers[b.z].push_back({b, &block});
  return block;
}

std::vector<Tile> Window::tiles(int level, std::int32_t slab) const {
  const std::int32_t first = lattice_.first_layer(level, slab);
  const std::int32_t last = first + lattice_.layers(level) - 1;
  const auto& layers = trees_->levels[level].layers;
  std::vector<Tile> out;
  for (auto it = layers.lower_bound(first >> 3); it != layers.end() && it->first <= (last >> 3); ++it) {
    const auto begin = out.insert(out.end(), it->second.begin(), it->second.end());
    std::sort(begin, out.end(), [](const Tile& a, const Tile& b) {
      return std::tie(a.block.z, a.block.y, a.block.x) < std::tie(b.block.z, b.block.y, b.block.x);
    });
  }
  return out;
}

void Window::retire_values(std::int32_t slab) {
  for (int level = 0; level < levels(); ++level) {
    const int brick = brick_of(level, lattice_.first_layer(level, slab) & 7);
    const int bricks = lattice_.layers(level) >= 8 ? 8 : 1;  // a slab of many layers owns its leaves whole
    for (const Tile& t : tiles(level, slab)) {
      for (int b = brick; b < std::min(8, brick + bricks); ++b) t.leaf->values[b] = {};
    }
  }
}

void Window::retire_below(std::int32_t slab) {
  for (int level = 0; level < levels(); ++level) {
    const std::int32_t first = lattice_.first_layer(level, slab);
    auto& [tree, layers] = trees_->levels[level];
    while (!layers.empty() && layers.begin()->first * 8 + 8 <= first) {
      for (const Tile& t : layers.begin()->second) {
        delete tree.stealNode<CornerLeaf>(leaf_origin(t.block), false, false);
      }
      layers.erase(layers.begin());
    }
  }
}

std::size_t Window::leaf_count() const {
  std::size_t n = 0;
  for (const auto& level : trees_->levels) {
    for (const auto& [z, tiles] : level.layers) n += tiles.size();
  }
  return n;
}

std::size_t Window::memory() const {
  std::size_t bytes = 0;
  for (const auto& level : trees_->levels) {
    for (const auto& [z, tiles] : level.layers) {
      for (const Tile& t : tiles) {
        bytes += sizeof(CornerLeaf);
        for (const CornerValues& v : t.leaf->values) bytes += sizeof(float) * v.data.capacity();
      }
    }
  }
  return bytes;
}

}  // namespace lamina
