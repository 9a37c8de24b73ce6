// Known voxels tell those around them what they make of the distance there.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "levelset/band_reach.h"
#include "levelset/brick.h"

namespace lamina::volume {

/// Weighted sums at the voxels of a brick.
struct Sums {
  std::array<float, 512> weight;
  std::array<Plane, 512> total;  ///< normal and distance
  std::vector<float> extra;      ///< 512 for each channel

  void clear(int at, std::size_t channels) {
    weight[at] = 0;
    total[at] = Plane{};
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] = 0;
  }
  void add(int at, float w, const Plane& plane, const Brick& from, int from_at, std::size_t channels) {
    weight[at] += w;
    total[at] += w * plane;
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] += w * from.extra[c * 512 + from_at];
  }
};

/// A voxel with something to say.
struct Pusher {
  const Brick* from;
  PairBits beside;        ///< who wants to hear it
  std::int16_t at, here;  ///< its place in its own brick, and as seen from the one of the sums
};

using Push = void (*)(std::span<const Pusher> pushers, std::size_t channels, Sums& sums);

/// The ways to do it that this processor knows, the fastest last. All give the same bits.
std::vector<Push> available_pushes();

}  // namespace lamina::volume
