// Voxels beside those of masks, a brick at a time.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "lattice/bits.h"
#include "lattice/block_mask.h"

namespace lamina::volume {

/// A mask of a brick and of those around, x fastest, its own in the middle; bits::kNoBits where there is no brick.
using Around = std::array<const BlockMask*, 27>;

namespace beside_detail {

using Words = std::array<std::uint64_t, 8>;
constexpr std::uint64_t kFirst = bits::columns_below(1), kLast = kFirst << 7;

inline std::uint64_t spread_x(std::uint64_t left, std::uint64_t here, std::uint64_t right) {
  return here | (here & ~kLast) << 1 | (here & ~kFirst) >> 1 | (left >> 7 & kFirst) | (right & kFirst) << 7;
}
inline std::uint64_t spread_y(std::uint64_t front, std::uint64_t here, std::uint64_t back) {
  return here | here << 8 | here >> 8 | front >> 56 | back << 56;
}
inline void spread_z(const BlockMask& below, const BlockMask& here, const BlockMask& above, Words& out) {
  out[0] = below.words[7] | here.words[0] | here.words[1];
  for (std::size_t z = 1; z < 7; ++z) out[z] = here.words[z - 1] | here.words[z] | here.words[z + 1];
  out[7] = here.words[6] | here.words[7] | above.words[0];
}

}  // namespace beside_detail

/// Voxels that share a corner, an edge or a face with one of the masks, and those themselves.
inline BlockMask beside(const Around& masks) {
  using namespace beside_detail;
  std::array<Words, 3> columns;
  for (std::size_t x = 0; x < 3; ++x) {
    std::array<Words, 3> rows;
    for (std::size_t y = 0; y < 3; ++y) {
      const std::size_t i = x + 3 * y;
      spread_z(*masks[i], *masks[i + 9], *masks[i + 18], rows[y]);
    }
    for (std::size_t z = 0; z < 8; ++z) columns[x][z] = spread_y(rows[0][z], rows[1][z], rows[2][z]);
  }
  BlockMask out;
  for (std::size_t z = 0; z < 8; ++z) out.words[z] = spread_x(columns[0][z], columns[1][z], columns[2][z]);
  return out;
}

/// Voxels that share a face with one of the masks, and those themselves.
inline BlockMask facing(const Around& masks) {
  using namespace beside_detail;
  const BlockMask& here = *masks[13];
  BlockMask out;
  spread_z(*masks[4], here, *masks[22], out.words);
  for (std::size_t z = 0; z < 8; ++z) {
    const std::uint64_t w = here.words[z];
    out.words[z] |=
        spread_x(masks[12]->words[z], w, masks[14]->words[z]) | spread_y(masks[10]->words[z], w, masks[16]->words[z]);
  }
  return out;
}

/// beside() of a single brick's mask: its ten layers, those of the bricks below and above included.
inline std::array<std::uint64_t, 10> beside_alone(const BlockMask& mask) {
  using namespace beside_detail;
  std::array<std::uint64_t, 12> w{};
  for (std::size_t z = 0; z < 8; ++z) w[z + 2] = mask.words[z];
  std::array<std::uint64_t, 10> out;
  for (std::size_t z = 0; z < 10; ++z) out[z] = spread_x(0, spread_y(0, w[z] | w[z + 1] | w[z + 2], 0), 0);
  return out;
}

}  // namespace lamina::volume
