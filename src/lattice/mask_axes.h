// Block masks with their axes exchanged, many voxels at a time.
#pragma once
#include <array>
#include <cstdint>
#include <utility>

#include "lattice/block_mask.h"

namespace lamina::volume {

/// Exchanges x and y: every word is a matrix of 8 x 8 bits.
inline void swap_x_y(BlockMask& mask) {
  for (std::uint64_t& w : mask.words) {
    const auto exchange = [&w](int by, std::uint64_t which) {
      const std::uint64_t t = (w ^ (w >> by)) & which;
      w ^= t ^ (t << by);
    };
    exchange(7, 0x00AA00AA00AA00AAULL);
    exchange(14, 0x0000CCCC0000CCCCULL);
    exchange(28, 0x00000000F0F0F0F0ULL);
  }
}

/// Exchanges y and z: a matrix of 8 x 8 bytes.
inline void swap_y_z(BlockMask& mask) {
  const BlockMask from = mask;
  for (int y = 0; y < 8; ++y) {
    std::uint64_t w = 0;
    for (int z = 0; z < 8; ++z) w |= (from.words[z] >> (8 * y) & 0xFF) << (8 * z);
    mask.words[y] = w;
  }
}

/// `to`: where axis x, y, z go, 0 for x.
inline BlockMask with_axes(const BlockMask& of, std::array<int, 3> to) {
  BlockMask mask = of;
  const auto sort_lower = [&] {
    if (to[0] > to[1]) std::swap(to[0], to[1]), swap_x_y(mask);
  };
  sort_lower();
  if (to[1] > to[2]) std::swap(to[1], to[2]), swap_y_z(mask);
  sort_lower();
  return mask;
}

}  // namespace lamina::volume
