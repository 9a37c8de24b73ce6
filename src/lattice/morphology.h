// Morphology of block masks, a 64-bit word (8 x 8) at a time.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "lattice/block_mask.h"

namespace lamina::bits {

/// Columns x < n of every row.
constexpr std::uint64_t columns_below(int n) {
  return n >= 8 ? ~std::uint64_t{0} : 0x0101010101010101ULL * ((1ULL << n) - 1);
}

/// Rows y < n.
constexpr std::uint64_t rows_below(int n) {
  return n >= 8 ? ~std::uint64_t{0} : (std::uint64_t{1} << (8 * n)) - 1;
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

/// The union of the rows' moves by [lo, hi]; rows come in from the words below and above.
template <int kLo, int kHi>
constexpr std::uint64_t spread_y(std::uint64_t below, std::uint64_t here, std::uint64_t above) {
  static_assert(kLo <= 0 && kHi >= 0);
  std::uint64_t out = here;
  if constexpr (kLo == -kHi && (kHi & (kHi + 1)) == 0) {  // by doubling
    for (int d = 1; d <= kHi; d *= 2) out |= (out << (8 * d)) | (out >> (8 * d));
    below >>= 8 * (8 - kHi);
    above <<= 8 * (8 - kHi);
    for (int d = 0; d < kHi; ++d) out |= (below >> (8 * d)) | (above << (8 * d));
  } else {
    for (int d = kLo; d <= kHi; ++d) out |= shift_y(below, here, above, d);
  }
  return out;
}

/// The union of the columns' moves by [lo, hi].
template <int kLo, int kHi>
constexpr std::uint64_t spread_x(std::uint64_t left, std::uint64_t here, std::uint64_t right) {
  std::uint64_t out = here;
  if constexpr (kLo == -kHi && (kHi & (kHi + 1)) == 0) {
    for (int d = 1; d <= kHi; d *= 2) {
      out |= ((out & columns_below(8 - d)) << d) | ((out & ~columns_below(d)) >> d);
    }
    left = (left >> (8 - kHi)) & columns_below(kHi);
    right = (right << (8 - kHi)) & ~columns_below(8 - kHi);
    std::uint64_t low = 0, high = 0;
    for (int d = 0; d < kHi; ++d) low |= left >> d, high |= right << d;
    out |= (low & columns_below(kHi)) | (high & ~columns_below(8 - kHi));
  } else {
    for (int d = kLo; d <= kHi; ++d) out |= shift_x(left, here, right, d);
  }
  return out;
}

inline constexpr BlockMask kNoBits{};

/// A fixed number of layers from `begin` on, so that every loop unrolls: a pass per axis over all of them.
template <int kLo, int kHi, int kCount>
void dilate_some(const Neighbourhood& n, int begin, std::uint64_t* out) {
  constexpr int kWidth = kHi - kLo + 1;
  std::array<std::array<std::uint64_t, kCount>, 3> columns{};
  for (int x = 0; x < 3; ++x) {
    std::array<std::array<std::uint64_t, kCount + kWidth - 1>, 3> rows;
    std::uint64_t any = 0;
    for (int y = 0; y < 3; ++y) {
      std::array<std::uint64_t, kCount + kWidth - 1>& row = rows[y];
      std::array<const std::uint64_t*, 3> blocks;
      for (int z = 0; z < 3; ++z) blocks[z] = (n[z][y][x] == nullptr ? kNoBits : *n[z][y][x]).words.data();
      for (int i = 0; i < kCount + kWidth - 1; ++i) {
        const int z = begin - kHi + i + 8;
        row[i] = blocks[z >> 3][z & 7];
        any |= row[i];
      }
      int width = 1;  // row[i] holds the union of so many layers
      for (; 2 * width <= kWidth; width *= 2) {
        for (int i = 0; i + 2 * width < kCount + kWidth; ++i) row[i] |= row[i + width];
      }
      if (width == kWidth) continue;
      for (int i = 0; i < kCount; ++i) row[i] |= row[i + kWidth - width];
    }
    if (any == 0) continue;
    for (int i = 0; i < kCount; ++i) columns[x][i] = spread_y<kLo, kHi>(rows[0][i], rows[1][i], rows[2][i]);
  }
  for (int i = 0; i < kCount; ++i) out[i] = spread_x<kLo, kHi>(columns[0][i], columns[1][i], columns[2][i]);
}

/// dilate_layer() for the layers [begin, end) of the block, to `out` from its front.
template <int kLo, int kHi>
void dilate_layers(const Neighbourhood& n, int begin, int end, std::uint64_t* out) {
  for (int count = 0; begin < end; begin += count, out += count) {
    count = static_cast<int>(std::bit_floor(static_cast<unsigned>(end - begin)));
    switch (count) {
      case 1:
        dilate_some<kLo, kHi, 1>(n, begin, out);
        break;
      case 2:
        dilate_some<kLo, kHi, 2>(n, begin, out);
        break;
      case 4:
        dilate_some<kLo, kHi, 4>(n, begin, out);
        break;
      default:
        dilate_some<kLo, kHi, 8>(n, begin, out);
    }
  }
}

/// dilate_layers<-1, 1>() of the whole block: what shares a corner, an edge or a face with the mask, and the mask
/// itself.
inline BlockMask dilate(const Neighbourhood& n) {
  BlockMask out;
  dilate_layers<-1, 1>(n, 0, 8, out.words.data());
  return out;
}

/// The same of a mask with nothing around it: its ten layers, those of the blocks below and above included.
inline std::array<std::uint64_t, 10> dilate_alone(const BlockMask& mask) {
  std::array<std::uint64_t, 12> w{};
  std::copy(mask.words.begin(), mask.words.end(), w.begin() + 2);
  std::array<std::uint64_t, 10> out;
  for (std::size_t z = 0; z < 10; ++z)
    out[z] = spread_x<-1, 1>(0, spread_y<-1, 1>(0, w[z] | w[z + 1] | w[z + 2], 0), 0);
  return out;
}

/// What shares a face with the mask, and the mask itself.
inline BlockMask dilate_by_faces(const Neighbourhood& n) {
  const auto layer = [&n](int z, int y, int x) { return word(n, z, y, x); };
  BlockMask out;
  for (int z = 0; z < 8; ++z) {
    const std::uint64_t here = layer(z, 1, 1);
    out.words[z] = layer(z - 1, 1, 1) | layer(z + 1, 1, 1) | spread_x<-1, 1>(layer(z, 1, 0), here, layer(z, 1, 2)) |
                   spread_y<-1, 1>(layer(z, 0, 1), here, layer(z, 2, 1));
  }
  return out;
}
inline BlockMask dilate_by_faces(const BlockMask& alone) {
  BlockMask out = alone;
  for (std::size_t z = 0; z < 8; ++z) {
    const std::uint64_t here = alone.words[z];
    out.words[z] |= spread_x<-1, 1>(0, here, 0) | spread_y<-1, 1>(0, here, 0);
    if (z > 0) out.words[z] |= alone.words[z - 1];
    if (z < 7) out.words[z] |= alone.words[z + 1];
  }
  return out;
}

/// All of `within` that is connected with `seeds` there, through faces.
inline BlockMask connected(const BlockMask& seeds, const BlockMask& within) {
  BlockMask out = seeds;
  for (BlockMask before = out;; before = out) {
    out |= dilate_by_faces(out) & within;
    if (out == before) return out;
  }
}

/// Bits that are not `known` take the side of the nearest that are, outside first. `negative`: the inside of `known`.
inline BlockMask fill_sides(const BlockMask& negative, const BlockMask& known) {
  BlockMask inside = negative, outside = known & ~inside;
  if (!inside.any()) return inside;
  for (BlockMask rest = ~known; rest.any(); rest = ~(inside | outside)) {
    const BlockMask more = dilate_by_faces(outside) & rest;
    inside |= dilate_by_faces(inside) & rest & ~more;
    outside |= more;
  }
  return inside;
}

/// The bits at the lower or upper end of an axis, 0 for x.
constexpr BlockMask face(int axis, bool upper) {
  BlockMask out;
  for (int z = 0; z < 8; ++z) {
    if (axis == 0) out.words[z] = columns_below(1) << (upper ? 7 : 0);
    if (axis == 1) out.words[z] = std::uint64_t{0xFF} << (upper ? 56 : 0);
    if (axis == 2) out.words[z] = z == (upper ? 7 : 0) ? ~std::uint64_t{0} : 0;
  }
  return out;
}

/// Those of a mask's bits, as the block beyond sees them: at its own other end.
inline BlockMask across(const BlockMask& mask, int axis, bool upper) {
  BlockMask out = mask & face(axis, upper);
  if (axis == 2) {
    std::swap(out.words[0], out.words[7]);
    return out;
  }
  const int by = axis == 0 ? 7 : 56;
  for (std::uint64_t& w : out.words) w = upper ? w >> by : w << by;
  return out;
}

/// Spreads a 4 x 4 quarter of a word (columns qx*4.., rows qy*4..) to 8 x 8, each bit to 2 x 2.
constexpr std::uint64_t spread_quarter(std::uint64_t w, int qx, int qy) {
  std::uint64_t x = (w >> (32 * qy + 4 * qx)) & 0x0F0F0F0FU;
  x = (x | (x << 16)) & 0x0000FFFF0000FFFFULL;  // rows to even rows
  x = (x | (x << 8)) & 0x00FF00FF00FF00FFULL;
  x = (x | (x << 2)) & 0x0033003300330033ULL;  // columns to even columns
  x = (x | (x << 1)) & 0x0055005500550055ULL;
  x |= x << 1;
  return x | (x << 8);
}

/// Gathers an 8 x 8 word to a 4 x 4 quarter: bits of even rows and columns.
constexpr std::uint64_t even_quarter(std::uint64_t w, int qx, int qy) {
  std::uint64_t x = w & 0x0055005500550055ULL;
  x = (x | (x >> 1)) & 0x0033003300330033ULL;
  x = (x | (x >> 2)) & 0x000F000F000F000FULL;
  x = (x | (x >> 8)) & 0x00000F0F00000F0FULL;
  x = (x | (x >> 16)) & 0x0F0F0F0FULL;
  return x << (32 * qy + 4 * qx);
}

/// ORs 2 x 2 bits of a word into one of its even row and column.
constexpr std::uint64_t fold_pairs(std::uint64_t w) {
  const std::uint64_t x = w | (w >> 1);
  return x | (x >> 8);
}

}  // namespace lamina::bits
