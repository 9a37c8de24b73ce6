// A window filled directly from an octree and a field, for tests of the stages behind projection.
#pragma once
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "octree/window.h"

namespace lamina::test {

/// What a test says about the corner at a finest-lattice position.
struct FieldSample {
  float distance = 1;  ///< steps
  std::array<float, 3> normal{0, 0, 1};
  bool seen = true;
  bool defined = true;  ///< the sign is more than a guess; what is seen always is
};

/// A dense octree over `size` coarsest cells from `origin` on (in coarsest cells); levels counted from 0, the finest.
class Octree {
 public:
  enum State : std::uint8_t { absent, leaf, split, missing };  ///< missing: a leaf that takes no part

  Octree(int levels, std::array<int, 3> size, std::array<int, 3> origin)
      : levels_(levels), size_(size), origin_(origin) {
    for (int l = 0; l < levels; ++l) {
      const std::array<int, 3> n = cells(l);
      states_.emplace_back(static_cast<std::size_t>(n[0]) * n[1] * n[2], l + 1 == levels ? leaf : absent);
    }
  }
  [[nodiscard]] int levels() const { return levels_; }
  [[nodiscard]] std::array<int, 3> cells(int level) const {
    const int f = 1 << (levels_ - 1 - level);
    return {size_[0] * f, size_[1] * f, size_[2] * f};
  }
  [[nodiscard]] Cell first(int level) const {
    const int f = 1 << (levels_ - 1 - level);
    return {origin_[0] * f, origin_[1] * f, origin_[2] * f};
  }
  [[nodiscard]] State& at(int level, int x, int y, int z) {
    const std::array<int, 3> n = cells(level);
    return states_[level][static_cast<std::size_t>(x) +
                          static_cast<std::size_t>(n[0]) * (y + static_cast<std::size_t>(n[1]) * z)];
  }
  void subdivide(int level, int x, int y, int z) {
    at(level, x, y, z) = split;
    for (int i = 0; i < 8; ++i) at(level - 1, 2 * x + (i & 1), 2 * y + ((i >> 1) & 1), 2 * z + (i >> 2)) = leaf;
  }
  /// Calls f(level, x, y, z) for every existing cell, coarse ones first; f may subdivide what it is given.
  template <typename F>
  void for_cells(const F& f) {
    for (int l = levels_ - 1; l >= 0; --l) {
      const std::array<int, 3> n = cells(l);
      for (int z = 0; z < n[2]; ++z) {
        for (int y = 0; y < n[1]; ++y) {
          for (int x = 0; x < n[0]; ++x) {
            if (at(l, x, y, z) != absent) f(l, x, y, z);
          }
        }
      }
    }
  }
  [[nodiscard]] std::int32_t first_slab() const { return origin_[2]; }
  [[nodiscard]] std::int32_t end_slab() const { return origin_[2] + size_[2]; }

  /// The same octree under more, all subdivided, levels; sizes and origin must be divisible.
  [[nodiscard]] Octree under(int more) {
    const int f = 1 << more;
    Octree out(levels_ + more, {size_[0] / f, size_[1] / f, size_[2] / f},
               {origin_[0] / f, origin_[1] / f, origin_[2] / f});
    for (int l = 0; l < out.levels_; ++l) {
      if (l < levels_) {
        out.states_[l] = states_[l];
      } else {
        std::fill(out.states_[l].begin(), out.states_[l].end(), split);
      }
    }
    return out;
  }

  /// Fills the masks and values of a window of the same number of levels. `field` is asked by position (steps).
  void fill(Window& window, const std::function<FieldSample(const std::array<std::int32_t, 3>&)>& field) {
    for (int l = 0; l < levels_; ++l) {
      const std::array<int, 3> n = cells(l);
      const Cell base = first(l);
      // Blocks of all corners, the planes at the upper ends included.
      for (std::int32_t z = base.z >> 3; z <= (base.z + n[2]) >> 3; ++z) {
        for (std::int32_t y = base.y >> 3; y <= (base.y + n[1]) >> 3; ++y) {
          for (std::int32_t x = base.x >> 3; x <= (base.x + n[0]) >> 3; ++x) window.touch(l, {x, y, z});
        }
      }
    }
    for_cells([&](int l, int x, int y, int z) {
      const Cell c = first(l) + Cell{x, y, z};
      CornerBlock& block = *window.probe(l, block_of(c));
      if (at(l, x, y, z) == split) block.split.set(offset_in_block(c));
      if (at(l, x, y, z) != leaf) return;
      block.cells.set(offset_in_block(c));
      for (int i = 0; i < 8; ++i) {
        const Cell corner = c + Cell{i & 1, (i >> 1) & 1, i >> 2};
        window.probe(l, block_of(corner))->corners.set(offset_in_block(corner));
      }
    });
    for (int l = 0; l < levels_; ++l) {
      for (std::int32_t s = first_slab(); s <= end_slab(); ++s) {
        for (const Tile& t : window.tiles(l, s)) fill_values(window, l, t, s, field);
      }
    }
  }

 private:
  static void fill_values(Window& window, int level, const Tile& t, std::int32_t slab,
                          const std::function<FieldSample(const std::array<std::int32_t, 3>&)>& field) {
    const Lattice& lattice = window.lattice();
    std::vector<FieldSample> samples;
    int place = -1;
    for (int offset = 0; offset < 512; ++offset) {
      const Cell c{t.block.x * 8 + (offset & 7), t.block.y * 8 + ((offset >> 3) & 7), t.block.z * 8 + (offset >> 6)};
      if (lattice.slab_of_layer(level, c.z) != slab) continue;
      place = window.slab_in_leaf(level, offset >> 6);
      if (!t.leaf->corners.test(offset)) continue;
      const FieldSample s = field(lattice.position(level, c));
      t.leaf->outside.assign(offset, s.distance >= 0);
      t.leaf->defined.assign(offset, s.seen || s.defined);
      t.leaf->supported.assign(offset, s.seen);
      t.leaf->seen.assign(offset, s.seen);
      if (!t.leaf->defined.test(offset)) continue;
      // As if extended from elsewhere where it is not seen: the sign and the value are one.
      t.leaf->active.set(offset);
      t.leaf->trusted.set(offset);
      samples.push_back(s);
    }
    if (place < 0) return;
    CornerValues& values = t.leaf->values[place];
    values.allocate(static_cast<std::uint32_t>(samples.size()), window.channels());
    std::ranges::fill(values.all(), 0.0F);  // curvature and offset stay so
    for (std::size_t i = 0; i < samples.size(); ++i) {
      values.channel(kDistance)[i] = samples[i].distance;
      for (int a = 0; a < 3; ++a) values.channel(kNormalX + a)[i] = samples[i].normal[a];
    }
  }

  int levels_;
  std::array<int, 3> size_, origin_;
  std::vector<std::vector<State>> states_;
};

}  // namespace lamina::test
