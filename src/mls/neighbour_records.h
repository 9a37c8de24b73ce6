// The values of the corners around a corner.
#pragma once
#include <bit>
#include <cstdint>

#include "octree/corner_block.h"

namespace lamina {

/// Calls use(dx, dy, dz, record) for those of the 26 corners around one of a block that are in a mask (`seen` or a
/// subset of it) and have their values, in the order of for_neighbours(). Rows of corners share the search for their
/// first record.
template <typename Use>
void for_records_around(const CornerBlock& block, int offset, BlockMask Projected::*mask, int slab_layers,
                        const Use& use) {
  const int layer_shift = std::countr_zero(static_cast<unsigned>(slab_layers));
  const int x = offset & 7;
  for (int dz = -1; dz <= 1; ++dz) {
    const int z = (offset >> 6) + dz;
    const int layer = z & 7;
    for (int dy = -1; dy <= 1; ++dy) {
      const int y = ((offset >> 3) & 7) + dy;
      const int row = 8 * (y & 7);
      /// Of the corners in a block `beyond` from this one, by their bits in the row.
      const auto visit = [&](int beyond, unsigned wanted) {
        const CornerBlock* const from = block.around[CornerBlock::towards(beyond, y >> 3, z >> 3)];
        if (from == nullptr) return;
        auto bits = static_cast<unsigned>((from->*mask).words[layer] >> row) & wanted;
        if (bits == 0) return;
        const CornerValues& values = from->values[static_cast<std::size_t>(layer >> layer_shift)];
        if (values.count == 0) return;
        const std::uint32_t first = from->value_index(layer * 64 + row, slab_layers);
        const auto active = static_cast<unsigned>(from->active.words[layer] >> row);
        for (; bits != 0; bits &= bits - 1) {
          const int at = std::countr_zero(bits);
          const int before = std::popcount(active & ((1U << at) - 1));
          use(at + 8 * beyond - x, dy, dz, values.of(first + static_cast<std::uint32_t>(before)));
        }
      };
      const unsigned three = dy == 0 && dz == 0 ? 0b101U : 0b111U;
      if (x == 0 && (three & 1U) != 0) visit(-1, 0x80U);
      visit(0, (x == 0 ? three >> 1 : three << (x - 1)) & 0xFFU);
      if (x == 7) visit(1, 0x01U);
    }
  }
}

}  // namespace lamina
