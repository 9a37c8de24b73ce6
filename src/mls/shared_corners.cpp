#include "mls/shared_corners.h"

#include <algorithm>
#include <bit>

namespace lamina {

bool allocate_values(const Window& window, int level, Projected& points, int begin, int end) {
  std::uint32_t active = 0;
  for (int z = begin; z < end; ++z) active += static_cast<std::uint32_t>(std::popcount(points.active.words[z]));
  if (active == 0) return false;
  CornerValues& values = points.values[window.slab_in_leaf(level, begin)];
  values.allocate(active, window.channels());
  std::fill(values.data.begin(), values.data.end(), 0.0F);
  return true;
}

FinerCorner finer_corner(const Window& window, int level, const Tile& tile, int z, int bit) {
  return finer_corner(window, level,
                      {tile.block.x * 8 + (bit & 7), tile.block.y * 8 + (bit >> 3), tile.block.z * 8 + z});
}

void take_shared(const Window& window, int level, const Tile& tile, int z) {
  CornerBlock& leaf = *tile.leaf;
  for (std::uint64_t w = leaf.shared.words[z] & leaf.active.words[z]; w != 0; w &= w - 1) {
    const FinerCorner from = finer_corner(window, level, tile, z, std::countr_zero(w));
    const std::uint64_t one = w & (~w + 1);
    if (!from.block->seen.test(from.offset)) continue;
    leaf.seen.words[z] |= one;
    if (from.block->trusted.test(from.offset)) leaf.trusted.words[z] |= one;
    if (from.block->outside.test(from.offset)) leaf.outside.words[z] |= one;
  }
}

void copy_value(const Window& window, const FinerCorner& from, CornerValues& to, std::uint32_t at) {
  const CornerValues& source = from.block->values[window.slab_in_leaf(from.level, from.offset >> 6)];
  const std::uint32_t i = from.block->value_index(from.offset, window.slab_layers(from.level));
  std::copy_n(source.of(i), window.channels(), to.of(at));
}

void copy_shared(Window& window, int level, const Tile& tile, int begin, int end) {
  CornerBlock& leaf = *tile.leaf;
  CornerValues& values = leaf.values[window.slab_in_leaf(level, begin)];
  for (int z = begin; z < end; ++z) {
    take_shared(window, level, tile, z);
    for (std::uint64_t w = leaf.shared.words[z] & leaf.seen.words[z]; w != 0; w &= w - 1) {
      const int bit = std::countr_zero(w);
      copy_value(window, finer_corner(window, level, tile, z, bit), values,
                 leaf.value_index(z * 64 + bit, window.slab_layers(level)));
    }
  }
}

}  // namespace lamina
