// Directions of normals, still without a sign, by the planes of samples' neighbours; and the links between neighbours
// along which signs will travel.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "normals/planes.h"
#include "normals/sample_window.h"
#include "samples/sample_tree.h"

namespace lamina::normals {

inline constexpr std::size_t kLeastLinked = 12;  ///< neighbours that links are chosen from

struct DirectionSettings {
  int k = 16;               ///< neighbours the plane is fitted to, where they are not noisy
  float radius = 0;         ///< steps; above 0: all neighbours within it, however many
  float search_radius = 0;  ///< steps: samples farther apart are no neighbours
  bool lines = false;       ///< many samples lie on lines far apart: neighbours are to be from several of them
};

/// Finds the links of the samples links.core names, and the normals of those that have none. Where the nearest samples
/// lie on a line, as those of one scan line do, twice and four times as many are taken; where they are noisy, as many
/// as the noise asks for and the shape allows (choose_level()), about the same at neighbouring samples. A sample
/// whose neighbours make no plane is left without a normal.
void find_directions(const SampleTree& tree, const DirectionSettings& settings, WindowSamples& samples, Links& links);

// How far around a sample its plane must reach: among noise the nearest samples say little about the surface's
// direction, and beyond detail or an edge more of them say something else.

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

// Which sheet a noisy sample belongs to: between the faces of a thin wall noise leaves no gap, and neighbours there say
// that the two are one.

/// Squared distances, steps^2.
struct SheetReach {
  float plane = 0;    ///< of the samples that the normal's plane was fitted to
  float nearest = 0;  ///< of the first plane's, the nearest
};

/// How far along the normal the samples of a slim column around this one lie densest, steps: mean shift from the
/// sample's own height (Fukunaga and Hostetler 1975; Cheng 1995).
float height_of_sheet(const SampleTree& tree, std::uint32_t place, const std::array<float, 3>& normal,
                      const SheetReach& reach);

}  // namespace lamina::normals
