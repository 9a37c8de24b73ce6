// How far around a sample its plane must reach: among noise the nearest samples say little about the surface's
// direction, and beyond detail or an edge more of them say something else.
#pragma once
#include <cstdint>

#include "normals/directions.h"
#include "samples/sample_tree.h"

namespace lamina::normals {

/// Level l reaches as far as the nearest samples that the first plane was fitted to, times 2^(l/2): about 2^l times as
/// many samples.
inline constexpr std::uint8_t kMostLevel = 6;

/// Where a plane fit starts.
struct FirstFit {
  std::uint32_t place = 0;
  Plane plane;         ///< of the nearest samples
  double samples = 0;  ///< in it
  float squared = 0;   ///< distance of the farthest of them, steps^2
  float bound = 0;     ///< likewise: farther samples are no neighbours
};

/// The level from which on the direction is certain to a degree or two, or the last one that agrees with those before
/// it: a plane of more samples must lie within the uncertainty of the planes of fewer (Lepski's rule), its residual
/// must not grow as that of an edge or a curved surface does, and its samples must spread to both sides. 0 for samples
/// of little noise, after a look at the first plane alone.
std::uint8_t choose_level(const SampleTree& tree, const FirstFit& first);

/// Squared distance that a level reaches to, steps^2.
float reach_of_level(float first_squared, std::uint8_t level);

/// The plane of the samples within a squared distance; they count the less the farther away they are. Not valid where
/// there is none.
Plane plane_within(const SampleTree& tree, std::uint32_t place, float squared);

}  // namespace lamina::normals
