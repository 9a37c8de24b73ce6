// Finer cells where things are thin, by what the samples' normals say.
#pragma once
#include <cstdint>
#include <vector>

#include "lattice/lattice.h"
#include "store/slab_store.h"

namespace lamina {

/// Samples in whose 27 cells (of their own level, around the one they lie in) the normals cancel to less than kThin of
/// their number take a level less: two sheets lie there closer than a cell, or one turns sharply, and neither comes out
/// well in cells of that size. Depends on the samples given alone, in their order; those with radius 0 do not count.
void refine_thin(const Lattice& lattice, const LocalSamples& samples, const std::vector<float>& radius,
                 std::vector<std::uint8_t>& level);
inline constexpr float kThin = 0.5F;

}  // namespace lamina
