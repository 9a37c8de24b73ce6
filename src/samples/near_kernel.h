// The kernel of the search for nearest samples: which of many samples are near a box or near one of them, and in which
// order. One source (near_kernel_source.h), compiled per processor kind; all kinds give the same bits. Which samples
// are near is as good as random: nothing here branches on it.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "samples/nearest.h"

namespace lamina {

/// So many samples at once, at most: whoever loads them all may read as many less one behind the last.
inline constexpr std::size_t kNearLanes = 16;

/// Places [begin, end).
struct PlaceRange {
  std::uint32_t begin = 0, end = 0;
};

/// What lies within a squared distance (steps^2) of a box.
struct NearBox {
  std::array<std::int32_t, 3> low, high;
  float squared;
};

/// Copies of the samples near a leaf, itself among them.
struct SamplesNearLeaf {
  static constexpr std::size_t kMost = 256;
  static constexpr std::size_t kRoom = kMost + 2 * kNearLanes;  ///< a leaf more, and what fills up the last lanes

  std::array<std::array<std::int32_t, kRoom>, 3> at;
  std::array<std::int32_t, kRoom> places;
  std::size_t count = 0;
};

/// Samples near one of them, in the order in which they were found.
struct NearSamples {
  static constexpr std::size_t kMost = 64;

  std::array<float, SamplesNearLeaf::kRoom> squared;  ///< distances, steps^2
  std::array<std::int32_t, SamplesNearLeaf::kRoom> places;
  std::size_t count = 0;
};

struct NearKernel {
  /// Copies the samples of ranges, none of them longer than kNearLanes, that are near the box. False where they are
  /// more than kMost. No sample is farther from the box than from a sample in it, rounding included.
  bool (*gather)(const PlacedAxes& from, const PlaceRange* ranges, std::size_t count, const NearBox& box,
                 SamplesNearLeaf& out);
  /// Those within a squared distance of the one at `place`, itself left out. (It is what fills up the last lanes.)
  void (*find)(SamplesNearLeaf& from, const std::array<std::int32_t, 3>& at, std::int32_t place, float squared,
               NearSamples& out);
  /// Puts kMost samples at most in order, nearest first, into room for kMost + 2 * kNearLanes. False where some are as
  /// far as others: then it is no order.
  bool (*sort)(NearSamples& near, Neighbour* sorted);
};

/// Of the wanted processor kind.
const NearKernel& near_kernel();
/// Those that the processor runs.
std::vector<const NearKernel*> available_near_kernels();

namespace near_v2 {
extern const NearKernel kKernel;
}
namespace near_v3 {
extern const NearKernel kKernel;
}
namespace near_v4 {
extern const NearKernel kKernel;
}

}  // namespace lamina
