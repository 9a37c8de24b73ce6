#include "levelset/brick_sides.h"

#include <cstdint>

#include "lattice/bits.h"

namespace lamina::volume {
namespace {

/// A voxel's layer beside: one step along every axis.
BlockMask dilated(const BlockMask& m) {
  BlockMask out = m;
  for (int z = 0; z < 8; ++z) {
    const std::uint64_t w = m.words[z];
    out.words[z] |= bits::shift_x(0, w, 0, 1) | bits::shift_x(0, w, 0, -1) | w << 8 | w >> 8;
    if (z > 0) out.words[z] |= m.words[z - 1];
    if (z < 7) out.words[z] |= m.words[z + 1];
  }
  return out;
}

}  // namespace

BlockMask inside_of(const BlockMask& negative, const BlockMask& known) {
  BlockMask inside = negative, outside;
  std::uint64_t any_inside = 0, any_outside = 0;
  for (int z = 0; z < 8; ++z) {
    outside.words[z] = known.words[z] & ~negative.words[z];
    any_inside |= inside.words[z];
    any_outside |= outside.words[z];
  }
  if (any_inside == 0) return inside;
  if (any_outside == 0) {
    inside.words.fill(~std::uint64_t{0});
    return inside;
  }
  constexpr int kFarthest = 24;
  for (int step = 0; step < kFarthest; ++step) {
    std::uint64_t rest = 0;
    const BlockMask more = dilated(outside), less = dilated(inside);
    for (int z = 0; z < 8; ++z) {
      const std::uint64_t free = ~(inside.words[z] | outside.words[z]);
      outside.words[z] |= more.words[z] & free;
      inside.words[z] |= less.words[z] & free & ~more.words[z];
      rest |= free;
    }
    if (rest == 0) break;
  }
  return inside;
}

}  // namespace lamina::volume
