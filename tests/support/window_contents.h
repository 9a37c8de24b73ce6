// What a window holds, cell by cell, for comparing it with a brute force or with another window.
#pragma once
#include <bit>
#include <cstdint>
#include <set>
#include <vector>

#include "octree/window.h"

namespace lamina::test {

/// Calls f(level, cell, leaf, offset) for every set bit of a mask in the slabs [first, end), each once.
template <typename Mask, typename F>
void for_set(const Window& window, int level, std::int32_t first, std::int32_t end, Mask mask, const F& f) {
  for (std::int32_t slab = first; slab < end; ++slab) {
    for (const Tile& t : window.tiles(level, slab)) {
      for (int offset = 0; offset < 512; ++offset) {
        const Cell c{t.block.x * 8 + (offset & 7), t.block.y * 8 + ((offset >> 3) & 7), t.block.z * 8 + (offset >> 6)};
        if (window.lattice().slab_of_layer(level, c.z) != slab || !(t.leaf->*mask).test(offset)) continue;
        f(level, c, *t.leaf, offset);
      }
    }
  }
}

template <typename Mask>
std::set<Cell> set_cells(const Window& window, int level, std::int32_t first, std::int32_t end, Mask mask) {
  std::set<Cell> out;
  for_set(window, level, first, end, mask, [&](int, const Cell& c, const CornerBlock&, int) { out.insert(c); });
  return out;
}

/// A shared corner in the next finer level that holds it.
struct HeldCorner {
  int level;
  Cell corner;
  const CornerBlock* block;
};
inline HeldCorner held_finer(const Window& window, int level, const Cell& corner) {
  for (Cell c = corner; level-- > 0;) {
    c = {c.x * 2, c.y * 2, c.z * 2};
    const CornerBlock* block = window.probe(level, block_of(c));
    if (block != nullptr && block->corners.test(offset_in_block(c))) return {level, c, block};
  }
  return {};
}

inline void append_bits(const Window& window, int level, const Block& b, const Projected& points,
                        std::vector<std::uint64_t>& out) {
  for (const BlockMask* m : {&points.active, &points.seen, &points.trusted}) {
    out.insert(out.end(), m->words.begin(), m->words.end());
  }
  for (int layer = 0; layer < 8; layer += window.slab_layers(level)) {
    const CornerValues& v = points.values[window.slab_in_leaf(level, layer)];
    out.push_back(v.count);
    for (const float f : v.all()) out.push_back(std::bit_cast<std::uint32_t>(f));
  }
  out.push_back(static_cast<std::uint32_t>(b.x));
}

/// Every bit that stages up to extension leave behind, in canonical order.
inline std::vector<std::uint64_t> all_bits(const Window& window, std::int32_t first, std::int32_t end) {
  std::vector<std::uint64_t> out;
  for (int level = 0; level < window.levels(); ++level) {
    Block done{};
    for (std::int32_t slab = first; slab < end; ++slab) {
      for (const Tile& t : window.tiles(level, slab)) {
        if (slab > first && t.block.z <= done.z) continue;  // coarse leaves hold several slabs
        for (const BlockMask* m : {&t.leaf->split, &t.leaf->cells, &t.leaf->corners, &t.leaf->shared}) {
          out.insert(out.end(), m->words.begin(), m->words.end());
        }
        append_bits(window, level, t.block, *t.leaf, out);
        if (t.leaf->centres != nullptr) append_bits(window, level, t.block, *t.leaf->centres, out);
      }
      done.z = (window.lattice().first_layer(level, slab) + window.lattice().layers(level) - 1) >> 3;
    }
  }
  return out;
}

}  // namespace lamina::test
