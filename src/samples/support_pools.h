// H of places by what disks of several widths predicted there and around.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "samples/support_field.h"

namespace lamina {

/// Radii of the disks that are tried, in radii of the samples.
inline constexpr std::array<float, 6> kDisks{1, 1.4F, 2, 2.8F, 4, 5.6F};
inline constexpr std::size_t kMiddleDisk = 2;

/// How far a seed, the origin, is from what disks of neighbours suggest, in radii; without the last ones where the
/// disks are wider than neighbours are known.
struct Trial {
  std::array<float, kDisks.size()> error{};
  float all_round = 0;  ///< neighbours lie on all sides of it within so many radii; infinite: in no disk
};

/// A sample and what its neighbours say.
struct TriedPlace {
  std::array<std::int32_t, 3> at{};  ///< steps
  Trial trial;
};

/// H at each place. Those nearest to it, 64 of them, are looked at together, and 128 as well: how much of what tells
/// the first from the second is chance shows in how far halves of the first differ, and H moves towards the second by
/// that share, the same all over the cloud, where it is wider (shrinkage: James and Stein 1961). It does not where it
/// is narrower: averaging too little costs more than too much. Empty places where all_round is the aim and samples do
/// not lie on lines. A function of the places and their order alone.
SupportSurvey pool_places(const std::vector<TriedPlace>& places, SupportAim aim);

}  // namespace lamina
