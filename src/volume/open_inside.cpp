#include "volume/open_inside.h"

#include <array>
#include <map>
#include <utility>
#include <vector>

namespace lamina::volume {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using BandLeaf = FloatTree::LeafNodeType;

constexpr int kLeafSide = 8;
/// Voxels of a leaf: words of x, bits of 8 y + z, as OpenVDB counts.
using Voxels = std::array<std::uint64_t, kLeafSide>;
constexpr std::uint64_t kLowY = 0xFF, kLowZ = 0x0101010101010101;

/// Of the six faces: low and high end of axis 0, 1, 2.
Voxels face(int which) {
  Voxels out{};
  const bool high = (which & 1) != 0;
  for (std::size_t x = 0; x < kLeafSide; ++x) {
    if (which / 2 == 0) out[x] = x == (high ? kLeafSide - 1 : 0) ? ~std::uint64_t{0} : 0;
    if (which / 2 == 1) out[x] = high ? kLowY << 56 : kLowY;
    if (which / 2 == 2) out[x] = high ? kLowZ << 7 : kLowZ;
  }
  return out;
}

/// Voxels on one end of an axis, seen from the leaf beyond.
Voxels across(const Voxels& v, int which) {
  Voxels out{};
  const bool high = (which & 1) != 0;
  for (std::size_t x = 0; x < kLeafSide; ++x) {
    if (which / 2 == 0) out[kLeafSide - 1 - x] = x == (high ? kLeafSide - 1 : 0) ? v[x] : 0;
    if (which / 2 == 1) out[x] = high ? v[x] >> 56 : v[x] << 56;
    if (which / 2 == 2) out[x] = high ? (v[x] >> 7) & kLowZ : (v[x] & kLowZ) << 7;
  }
  return out;
}

/// All of `within` that is connected with `seeds` there.
Voxels connected(Voxels seeds, const Voxels& within) {
  for (bool grows = true; grows;) {
    grows = false;
    for (std::size_t x = 0; x < kLeafSide; ++x) {
      const std::uint64_t v = seeds[x];
      std::uint64_t more = v | v << 8 | v >> 8 | (v << 1 & ~kLowZ) | (v >> 1 & ~(kLowZ << 7));
      if (x > 0) more |= seeds[x - 1];
      if (x + 1 < kLeafSide) more |= seeds[x + 1];
      more &= within[x];
      grows = grows || more != v;
      seeds[x] = more;
    }
  }
  return seeds;
}

class OpenInside {
 public:
  explicit OpenInside(FloatGrid& grid) : tree_(grid.tree()), cells_(grid.tree()), background_(grid.background()) {}

  void empty() {
    begin();
    while (!seeds_.empty() || !tiles_.empty()) {
      while (!tiles_.empty()) {
        const auto [origin, side] = tiles_.back();
        tiles_.pop_back();
        for_cells_beside(origin, side, [&](const Coord& cell, int which) { enter(cell, across(face(which), which)); });
      }
      if (seeds_.empty()) break;
      const auto seed = seeds_.extract(seeds_.begin());
      spread(seed.key(), seed.mapped());
    }
    for (const auto& [origin, voxels] : reached_) {
      BandLeaf& leaf = *tree_.probeLeaf(origin);
      for (openvdb::Index i = 0; i < BandLeaf::SIZE; ++i)
        if ((voxels[i >> 6] >> (i & 63) & 1U) != 0) leaf.setValueOnly(i, background_);
    }
  }

 private:
  /// Leaf-sized cells that share a face with a cube; `which`: the cube's face.
  template <class Visit>
  void for_cells_beside(const Coord& origin, int side, const Visit& visit) {
    for (int which = 0; which < 6; ++which) {
      const int axis = which / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
      Coord cell = origin;
      cell[axis] += (which & 1) != 0 ? side : -kLeafSide;
      for (int i = 0; i < side; i += kLeafSide) {
        for (int j = 0; j < side; j += kLeafSide) {
          cell[u] = origin[u] + i;
          cell[v] = origin[v] + j;
          visit(cell, which);
        }
      }
    }
  }

  [[nodiscard]] bool is_outside_tile(const Coord& cell) {
    return cells_.probeConstLeaf(cell) == nullptr && cells_.getValue(cell) > 0;
  }

  void begin() {
    for (auto leaf = tree_.cbeginLeaf(); leaf; ++leaf) {
      for_cells_beside(leaf->origin(), kLeafSide, [&](const Coord& cell, int which) {
        if (is_outside_tile(cell)) add(leaf->origin(), face(which));
      });
    }
    std::vector<Coord> open;
    auto tile = tree_.cbeginValueOff();
    tile.setMaxDepth(FloatTree::ValueOffCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
      if (*tile > 0) continue;
      openvdb::CoordBBox box;
      tile.getBoundingBox(box);
      bool beside = false;
      for_cells_beside(box.min(), box.dim()[0],
                       [&](const Coord& cell, int) { beside = beside || is_outside_tile(cell); });
      if (beside) open.push_back(box.min());
    }
    for (const Coord& origin : open) enter(origin, {});
  }

  void add(const Coord& leaf, const Voxels& voxels) {
    Voxels& all = seeds_[leaf];
    for (std::size_t x = 0; x < kLeafSide; ++x) all[x] |= voxels[x];
  }

  /// The outside reaches a leaf's voxels, or a tile.
  void enter(const Coord& cell, const Voxels& voxels) {
    if (cells_.probeConstLeaf(cell) != nullptr) return add(cell, voxels);
    if (cells_.getValue(cell) > 0) return;
    const int depth = tree_.getValueDepth(cell);
    const auto level = static_cast<openvdb::Index>(static_cast<int>(FloatTree::DEPTH) - 1 - depth);
    const int side = level == 1 ? kLeafSide : level == 2 ? kLeafSide * 16 : kLeafSide * 16 * 32;
    const Coord origin = cell & ~(side - 1);
    tree_.addTile(level, origin, background_, /*active*/ false);
    tiles_.emplace_back(origin, side);
  }

  void spread(const Coord& origin, const Voxels& seeds) {
    const BandLeaf& leaf = *tree_.probeConstLeaf(origin);
    Voxels free{};
    for (openvdb::Index i = 0; i < BandLeaf::SIZE; ++i)
      if (!leaf.isValueOn(i) && leaf.getValue(i) < 0) free[i >> 6] |= std::uint64_t{1} << (i & 63);
    Voxels& done = reached_[origin];
    Voxels from{};
    for (std::size_t x = 0; x < kLeafSide; ++x) from[x] = seeds[x] & free[x] & ~done[x];
    const Voxels now = connected(from, free);
    Voxels more{};
    std::uint64_t any = 0;
    for (std::size_t x = 0; x < kLeafSide; ++x) {
      more[x] = now[x] & ~done[x];
      done[x] |= now[x];
      any |= more[x];
    }
    if (any == 0) return;
    for_cells_beside(origin, kLeafSide, [&](const Coord& cell, int which) {
      const Voxels end = face(which);
      Voxels beyond{};
      std::uint64_t some = 0;
      for (std::size_t x = 0; x < kLeafSide; ++x) some |= beyond[x] = more[x] & end[x];
      if (some != 0) enter(cell, across(beyond, which));
    });
  }

  FloatTree& tree_;
  openvdb::tree::ValueAccessor<FloatTree, false> cells_;  ///< not registered with the tree: no leaf comes or goes
  float background_;
  std::map<Coord, Voxels> seeds_, reached_;
  std::vector<std::pair<Coord, int>> tiles_;  ///< turned, their neighbours not yet looked at; origin and side
};

}  // namespace

void empty_open_inside(openvdb::FloatGrid& grid) {
  OpenInside(grid).empty();
}

}  // namespace lamina::volume
