// Morphology on 8^3 bit blocks, a 64-bit word (8 x 8) at a time.
#pragma once
#include <array>
#include <cstdint>

#include "window/corner_block.h"

namespace lamina::bits {

/// Columns x < n of every row.
constexpr std::uint64_t columns_below(int n) {
  return n >= 8 ? ~std::uint64_t{0} : 0x0101010101010101ULL * ((1ULL << n) - 1);
}

/// Row shift: result row y is the source's row y - d; rows come in from the neighbouring words below (y - 1) and above.
constexpr std::uint64_t shift_y(std::uint64_t below, std::uint64_t here, std::uint64_t above, int d) {
  if (d == 0) return here;
  return d > 0 ? (here << (8 * d)) | (below >> (8 * (8 - d))) : (here >> (-8 * d)) | (above << (8 * (8 + d)));
}

/// Column shift: result column x is the source's column x - d.
constexpr std::uint64_t shift_x(std::uint64_t left, std::uint64_t here, std::uint64_t right, int d) {
  if (d == 0) return here;
  if (d > 0) {
    return ((here & columns_below(8 - d)) << d) | ((left >> (8 - d)) & columns_below(d));
  }
  return ((here & ~columns_below(-d)) >> -d) | ((right << (8 + d)) & ~columns_below(8 + d));
}

/// A mask of a block and of its 26 neighbours, [z][y][x] with 1 in the middle; null is empty.
using Neighbourhood = std::array<std::array<std::array<const BlockMask*, 3>, 3>, 3>;

/// Word of layer z in [-8, 16) of the column of blocks (y, x).
inline std::uint64_t word(const Neighbourhood& n, int z, int y, int x) {
  const BlockMask* m = n[(z >> 3) + 1][y][x];
  return m == nullptr ? 0 : m->words[z & 7];
}

/// Layer z of the union of the mask moved by every offset in [lo, hi]^3.
inline std::uint64_t dilate_layer(const Neighbourhood& n, int z, int lo, int hi) {
  std::array<std::uint64_t, 3> columns{};
  for (int x = 0; x < 3; ++x) {
    std::array<std::uint64_t, 3> rows{};
    for (int y = 0; y < 3; ++y) {
      for (int d = lo; d <= hi; ++d) rows[y] |= word(n, z - d, y, x);
    }
    if ((rows[0] | rows[1] | rows[2]) == 0) continue;
    for (int d = lo; d <= hi; ++d) columns[x] |= shift_y(rows[0], rows[1], rows[2], d);
  }
  std::uint64_t out = 0;
  for (int d = lo; d <= hi; ++d) out |= shift_x(columns[0], columns[1], columns[2], d);
  return out;
}

/// Spreads a 4 x 4 quarter of a word (columns qx*4.., rows qy*4..) to 8 x 8, each bit to 2 x 2.
inline std::uint64_t spread_quarter(std::uint64_t w, int qx, int qy) {
  std::uint64_t out = 0;
  for (int r = 0; r < 4; ++r) {
    const auto nibble = static_cast<std::uint32_t>((w >> (8 * (qy * 4 + r) + qx * 4)) & 0xFU);
    // Bits 0-3 to even positions, then doubled.
    const std::uint32_t even = (nibble & 1U) | ((nibble & 2U) << 1) | ((nibble & 4U) << 2) | ((nibble & 8U) << 3);
    const std::uint64_t row = even * 3U;
    out |= (row | (row << 8)) << (16 * r);
  }
  return out;
}

/// Gathers an 8 x 8 word to a 4 x 4 quarter: bits of even rows and columns.
inline std::uint64_t even_quarter(std::uint64_t w, int qx, int qy) {
  std::uint64_t out = 0;
  for (int r = 0; r < 4; ++r) {
    const auto row = static_cast<std::uint32_t>((w >> (16 * r)) & 0x55U);
    const std::uint32_t nibble = (row & 1U) | ((row >> 1) & 2U) | ((row >> 2) & 4U) | ((row >> 3) & 8U);
    out |= std::uint64_t{nibble} << (8 * (qy * 4 + r) + qx * 4);
  }
  return out;
}

/// ORs 2 x 2 bits of a word into one of its even row and column.
constexpr std::uint64_t fold_pairs(std::uint64_t w) {
  const std::uint64_t x = w | (w >> 1);
  return x | (x >> 8);
}

}  // namespace lamina::bits
