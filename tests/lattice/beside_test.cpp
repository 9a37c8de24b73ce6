// Voxels beside those of masks, against looking at every voxel around.
#include "lattice/beside.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

namespace lamina::volume {
namespace {

/// Masks of 27 bricks, some of which are not there; few voxels are set, so that most words of the result are not full.
struct Bricks27 {
  std::vector<BlockMask> masks = std::vector<BlockMask>(27);
  Around around;

  Bricks27() {
    around.fill(&bits::kNoBits);
    for (std::size_t i = 0; i < 27; ++i) {
      if (*rc::gen::inRange(0, 4) == 0) continue;
      const auto voxels = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 512));
      for (const int at : voxels) masks[i].set(at);
      around[i] = &masks[i];
    }
  }
  [[nodiscard]] bool test(int x, int y, int z) const {
    const int i = (x + 8) / 8 + 3 * ((y + 8) / 8) + 9 * ((z + 8) / 8);
    return around[static_cast<std::size_t>(i)]->test(BlockMask::offset(x & 7, y & 7, z & 7));
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

RC_GTEST_PROP(Beside, AreAllThatShareACornerOrAFace, ()) {
  const Bricks27 c;
  const BlockMask corners = beside(c.around), faces = facing(c.around);
  for (int at = 0; at < 512; ++at) {
    RC_ASSERT(corners.test(at) == c.any(at & 7, at >> 3 & 7, at >> 6, 3));
    RC_ASSERT(faces.test(at) == c.any(at & 7, at >> 3 & 7, at >> 6, 1));
  }
}

RC_GTEST_PROP(Beside, OfOneBrickReachesTheLayersBelowAndAbove, ()) {
  Bricks27 c;
  for (std::size_t i = 0; i < 27; ++i)
    if (i != 13) c.around[i] = &bits::kNoBits;
  const auto layers = beside_alone(*c.around[13]);
  for (int z = -1; z < 9; ++z)
    for (int bit = 0; bit < 64; ++bit)
      RC_ASSERT(((layers[static_cast<std::size_t>(z + 1)] >> bit & 1) != 0) ==
                [&] {  // of the bricks below and above only the nearest layer can be asked for
                  for (int near = std::max(z - 1, 0); near <= std::min(z + 1, 7); ++near)
                    for (int dy = -1; dy <= 1; ++dy)
                      for (int dx = -1; dx <= 1; ++dx)
                        if (c.test((bit & 7) + dx, (bit >> 3) + dy, near)) return true;
                  return false;
                }());
}

}  // namespace
}  // namespace lamina::volume
