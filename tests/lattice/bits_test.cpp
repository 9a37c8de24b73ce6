#include "lattice/bits.h"

#include <gtest/gtest.h>

#include <random>

namespace lamina::bits {
namespace {

bool bit(std::uint64_t w, int x, int y) {
  return ((w >> (x + 8 * y)) & 1U) != 0;
}

/// Sparse to dense words.
std::uint64_t random_word(std::mt19937_64& random, std::uint64_t density) {
  std::uint64_t w = random();
  for (std::uint64_t i = 0; i < density; ++i) w &= random();
  return w;
}

TEST(Bits, ColumnsBelow) {
  for (int n = 0; n <= 8; ++n) {
    for (int i = 0; i < 64; ++i) EXPECT_EQ(bit(columns_below(n), i & 7, i >> 3), (i & 7) < n);
  }
}

TEST(Bits, ShiftsTakeInTheNeighbours) {
  std::mt19937_64 random(1);
  for (int round = 0; round < 20; ++round) {
    const std::uint64_t low = random();
    const std::uint64_t here = random();
    const std::uint64_t high = random();
    const auto at = [&](int i, int j, bool along_y) {
      const std::uint64_t w = i < 0 ? low : i < 8 ? here : high;
      return along_y ? bit(w, j, i & 7) : bit(w, i & 7, j);
    };
    for (int d = -4; d <= 4; ++d) {
      const std::uint64_t y = shift_y(low, here, high, d);
      const std::uint64_t x = shift_x(low, here, high, d);
      for (int i = 0; i < 8; ++i) {
        for (int j = 0; j < 8; ++j) {
          ASSERT_EQ(bit(y, j, i), at(i - d, j, true)) << "rows by " << d;
          ASSERT_EQ(bit(x, i, j), at(i - d, j, false)) << "columns by " << d;
        }
      }
    }
  }
}

TEST(Bits, DilationOfANeighbourhood) {
  std::mt19937_64 random(2);
  for (int round = 0; round < 40; ++round) {
    std::array<BlockMask, 27> masks;
    Neighbourhood n{};
    for (int i = 0; i < 27; ++i) {
      for (std::uint64_t& w : masks[i].words) w = random_word(random, 2 + random() % 6);
      if (random() % 4 != 0) n[i / 9][i / 3 % 3][i % 3] = &masks[i];
    }
    const auto on = [&](int x, int y, int z) {
      const BlockMask* m = n[(z >> 3) + 1][(y >> 3) + 1][(x >> 3) + 1];
      return m != nullptr && m->test(BlockMask::offset(x & 7, y & 7, z & 7));
    };
    const int lo = -static_cast<int>(random() % 3);
    const int hi = static_cast<int>(random() % 3);
    for (int z = 0; z < 8; ++z) {
      const std::uint64_t out = dilate_layer(n, z, lo, hi);
      for (int i = 0; i < 64; ++i) {
        bool expected = false;
        for (int dz = lo; dz <= hi; ++dz) {
          for (int dy = lo; dy <= hi; ++dy) {
            for (int dx = lo; dx <= hi; ++dx) expected = expected || on((i & 7) - dx, (i >> 3) - dy, z - dz);
          }
        }
        ASSERT_EQ(bit(out, i & 7, i >> 3), expected) << "offsets " << lo << ".." << hi;
      }
    }
  }
}

template <int kLo, int kHi>
void expect_layers_like_each_layer(const Neighbourhood& n, int begin, int end) {
  std::array<std::uint64_t, 10> out;
  out.fill(77);
  dilate_layers<kLo, kHi>(n, begin, end, out.data() + 1);
  for (int z = begin; z < end; ++z) ASSERT_EQ(out[1 + z - begin], dilate_layer(n, z, kLo, kHi)) << kLo << ".." << kHi;
  EXPECT_EQ(out[0], 77U);
  EXPECT_EQ(out[1 + end - begin], 77U);
}

TEST(Bits, DilationOfAllLayersAtOnce) {
  std::mt19937_64 random(4);
  for (int round = 0; round < 300; ++round) {
    std::array<BlockMask, 27> masks;
    Neighbourhood n{};
    for (int i = 0; i < 27; ++i) {
      for (std::uint64_t& w : masks[i].words) w = random_word(random, 2 + random() % 8);
      if (random() % 4 == 0) masks[i] = {};
      if (random() % 4 != 0) n[i / 9][i / 3 % 3][i % 3] = &masks[i];
    }
    const int end = 1 + static_cast<int>(random() % 8);
    const int begin = static_cast<int>(random() % static_cast<unsigned>(end));
    expect_layers_like_each_layer<-3, 3>(n, begin, end);
    expect_layers_like_each_layer<-1, 1>(n, begin, end);
    expect_layers_like_each_layer<0, 1>(n, begin, end);
    expect_layers_like_each_layer<-2, 3>(n, begin, end);
  }
}

TEST(Bits, QuartersUpAndDown) {
  std::mt19937_64 random(3);
  for (int round = 0; round < 50; ++round) {
    const std::uint64_t w = random_word(random, random() % 4);
    const std::uint64_t folded = fold_pairs(w);
    for (int q = 0; q < 4; ++q) {
      const int qx = q & 1;
      const int qy = q >> 1;
      const std::uint64_t spread = spread_quarter(w, qx, qy);
      const std::uint64_t even = even_quarter(w, qx, qy);
      const std::uint64_t pairs = even_quarter(folded, qx, qy);
      for (int y = 0; y < 8; ++y) {
        for (int x = 0; x < 8; ++x) {
          ASSERT_EQ(bit(spread, x, y), bit(w, 4 * qx + x / 2, 4 * qy + y / 2));
          const bool inside = x / 4 == qx && y / 4 == qy;
          const int cx = 2 * (x & 3);
          const int cy = 2 * (y & 3);
          ASSERT_EQ(bit(even, x, y), inside && bit(w, cx, cy));
          ASSERT_EQ(bit(pairs, x, y),
                    inside && (bit(w, cx, cy) || bit(w, cx + 1, cy) || bit(w, cx, cy + 1) || bit(w, cx + 1, cy + 1)));
        }
      }
    }
  }
}

}  // namespace
}  // namespace lamina::bits
