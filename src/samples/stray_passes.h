// How far strays look for neighbours: samples too sparse to have a dozen within reach are asked again among themselves,
// farther, and so on, so that the memory of every pass is that of the first.
#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "samples/cleaning.h"
#include "store/slab_store.h"

namespace lamina {

/// So many times farther each time.
inline constexpr double kNextReach = 4;
inline constexpr int kMostReaches = 4;

/// As a Neighbourhoods can take it, steps: an eighth of the longest diagonal there is at most.
inline float usable_reach(double reach) {
  return static_cast<float>(std::clamp(reach, 1.0, double{1 << 27}));
}

/// Whether so many samples without a dozen neighbours within reach are more than the far ends of a scan: than a dozen,
/// and than one in ten thousand of all.
inline bool are_many(std::uint64_t sparse, const SlabStore& store) {
  constexpr std::uint64_t kRarelySparse = 10000;
  return sparse > std::max<std::uint64_t>(kStrayNeighbours, store.total() / kRarelySparse);
}

/// Makes a sample one of those that are meant; false where it is already.
inline bool include(KeepMasks& masks, const SlabStore& store, std::uint32_t bucket, std::uint32_t number) {
  std::vector<bool>& mask = masks[bucket];
  mask.resize(store.count(bucket), false);
  if (mask[number]) return false;
  mask[number] = true;
  return true;
}

}  // namespace lamina
