#include "lattice/morphology.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <random>
#include <vector>

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

TEST(Morphology, ColumnsBelow) {
  for (int n = 0; n <= 8; ++n) {
    for (int i = 0; i < 64; ++i) EXPECT_EQ(bit(columns_below(n), i & 7, i >> 3), (i & 7) < n);
  }
}

TEST(Morphology, ShiftsTakeInTheNeighbours) {
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

TEST(Morphology, DilationOfANeighbourhood) {
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

TEST(Morphology, DilationOfAllLayersAtOnce) {
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

TEST(Morphology, QuartersUpAndDown) {
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

/// Masks of 27 blocks, some of which are not there; few bits are set, so that most words of the result are not full.
struct Blocks27 {
  std::vector<BlockMask> masks = std::vector<BlockMask>(27);
  Neighbourhood around{};

  Blocks27() {
    for (std::size_t i = 0; i < 27; ++i) {
      if (*rc::gen::inRange(0, 4) == 0) continue;
      const auto some = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 512));
      for (const int at : some) masks[i].set(at);
      around[i / 9][i / 3 % 3][i % 3] = &masks[i];
    }
  }
  [[nodiscard]] bool test(int x, int y, int z) const {
    const BlockMask* const mask = around[(z + 8) / 8][(y + 8) / 8][(x + 8) / 8];
    return mask != nullptr && mask->test(BlockMask::offset(x & 7, y & 7, z & 7));
  }
  /// Whether one no more than `axes` single steps along different axes away is set.
  [[nodiscard]] bool any(int x, int y, int z, int axes) const {
    for (int dz = -1; dz <= 1; ++dz)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
          if (std::abs(dx) + std::abs(dy) + std::abs(dz) <= axes && test(x + dx, y + dy, z + dz)) return true;
    return false;
  }
};

BlockMask some_bits(int most) {
  BlockMask mask;
  const auto some = *rc::gen::resize(most, rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 512)));
  for (const int at : some) mask.set(at);
  return mask;
}

/// Bits at distance 1 through faces.
std::vector<int> beside(int at) {
  std::vector<int> out;
  for (const int step : {1, 8, 64}) {
    if ((at / step & 7) > 0) out.push_back(at - step);
    if ((at / step & 7) < 7) out.push_back(at + step);
  }
  return out;
}

RC_GTEST_PROP(Morphology, DilationTakesInWhatSharesACornerOrAFace, ()) {
  const Blocks27 c;
  const BlockMask corners = dilate(c.around), faces = dilate_by_faces(c.around);
  for (int at = 0; at < 512; ++at) {
    RC_ASSERT(corners.test(at) == c.any(at & 7, at >> 3 & 7, at >> 6, 3));
    RC_ASSERT(faces.test(at) == c.any(at & 7, at >> 3 & 7, at >> 6, 1));
  }
}

RC_GTEST_PROP(Morphology, DilationOfOneBlockGoesIntoTheLayersBelowAndAbove, ()) {
  Blocks27 c;
  const BlockMask alone = c.masks[13];
  c.around = {};
  c.around[1][1][1] = &alone;
  const auto layers = dilate_alone(alone);
  for (int z = -1; z < 9; ++z)
    for (int bit = 0; bit < 64; ++bit)
      RC_ASSERT(((layers[static_cast<std::size_t>(z + 1)] >> bit & 1) != 0) ==
                [&] {  // of the blocks below and above only the nearest layer can be asked for
                  for (int near = std::max(z - 1, 0); near <= std::min(z + 1, 7); ++near)
                    for (int dy = -1; dy <= 1; ++dy)
                      for (int dx = -1; dx <= 1; ++dx)
                        if (c.test((bit & 7) + dx, (bit >> 3) + dy, near)) return true;
                  return false;
                }());
  RC_ASSERT(dilate_by_faces(alone) == dilate_by_faces(c.around));
}

RC_GTEST_PROP(Morphology, ConnectedIsWhatCanBeWalkedTo, ()) {
  const BlockMask within = ~some_bits(700), seeds = some_bits(3) & within;
  BlockMask walked = seeds;
  std::vector<int> todo;
  for (int at = 0; at < 512; ++at)
    if (seeds.test(at)) todo.push_back(at);
  while (!todo.empty()) {
    const int at = todo.back();
    todo.pop_back();
    for (const int next : beside(at)) {
      if (!within.test(next) || walked.test(next)) continue;
      walked.set(next);
      todo.push_back(next);
    }
  }
  RC_ASSERT(connected(seeds, within) == walked);
}

RC_GTEST_PROP(Morphology, SidesAreThoseOfTheNearestKnown, ()) {
  const BlockMask known = some_bits(20), inside = some_bits(600) & known;
  const BlockMask sides = fill_sides(inside, known);
  if (!inside.any()) {
    RC_ASSERT(!sides.any());
    return;
  }
  constexpr int kFar = 99;
  for (int at = 0; at < 512; ++at) {
    std::array<int, 2> nearest{kFar, kFar};  // outside, inside
    for (int other = 0; other < 512; ++other) {
      if (!known.test(other)) continue;
      int& least = nearest[inside.test(other) ? 1 : 0];
      least = std::min(least, std::abs((at & 7) - (other & 7)) + std::abs((at >> 3 & 7) - (other >> 3 & 7)) +
                                  std::abs((at >> 6) - (other >> 6)));
    }
    RC_ASSERT(sides.test(at) == (nearest[1] < nearest[0]));
  }
}

RC_GTEST_PROP(Morphology, FacesLieAcrossEachOther, ()) {
  const BlockMask mask = some_bits(400);
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool upper : {false, true}) {
      const int step = axis == 0 ? 1 : axis == 1 ? 8 : 64, end = upper ? 7 : 0;
      const BlockMask on_face = face(axis, upper), beyond = across(mask, axis, upper);
      for (int at = 0; at < 512; ++at) {
        const int place = at / step & 7;
        RC_ASSERT(on_face.test(at) == (place == end));
        RC_ASSERT(beyond.test(at) == (place == 7 - end && mask.test(at + (2 * end - 7) * step)));
      }
    }
  }
}

}  // namespace
}  // namespace lamina::bits
