#include "project/shared_corners.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace lamina {

bool allocate_values(const Window& window, int level, Projected& points, int begin, int end) {
  std::uint32_t near = 0;
  for (int z = begin; z < end; ++z) near += static_cast<std::uint32_t>(std::popcount(points.near.words[z]));
  if (near == 0) return false;
  CornerValues& values = points.values[window.brick_of(level, begin)];
  values.allocate(near, window.channels());
  std::fill(values.data.begin(), values.data.end(), 0.0F);
  return true;
}

void copy_shared(Window& window, int level, const Tile& tile, int begin, int end) {
  CornerBlock& leaf = *tile.leaf;
  CornerValues& values = leaf.values[window.brick_of(level, begin)];
  for (int z = begin; z < end; ++z) {
    for (std::uint64_t w = leaf.shared.words[z] & leaf.near.words[z]; w != 0; w &= w - 1) {
      const int bit = std::countr_zero(w);
      const int offset = z * 64 + bit;
      const Cell fine{(tile.block.x * 8 + (bit & 7)) * 2, (tile.block.y * 8 + (bit >> 3)) * 2,
                      (tile.block.z * 8 + z) * 2};
      const CornerBlock* from = std::as_const(window).probe(level - 1, block_of(fine));
      const int o = offset_in_block(fine);
      if (!from->seen.test(o)) continue;
      leaf.seen.set(offset);
      leaf.good.assign(offset, from->good.test(o));
      leaf.positive.assign(offset, from->positive.test(o));
      const CornerValues& source = from->values[window.brick_of(level - 1, o >> 6)];
      const std::uint32_t at = from->value_index(o, window.brick_layers(level - 1));
      const std::uint32_t to = leaf.value_index(offset, window.brick_layers(level));
      std::copy_n(source.of(at), window.channels(), values.of(to));
    }
  }
}

}  // namespace lamina
