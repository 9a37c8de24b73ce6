// Directions of normals without their sign, and the links along which signs will travel.
#pragma once
#include <cstdint>

#include "normals/sample_tree.h"
#include "normals/window_samples.h"

namespace lamina::normals {

struct DirectionSettings {
  int k = 16;        ///< neighbours the plane is fitted to
  float radius = 0;  ///< steps; above 0: all neighbours within it, however many
  float reach = 0;   ///< steps: farther samples are nobody's neighbours
};

/// Finds the links of the samples links.core names, and the normals of those that have none. Where the nearest samples
/// lie on a line, as those of one scan line do, twice and four times as many are taken. A sample whose neighbours
/// make no plane is left without a normal.
void find_directions(const SampleTree& tree, const DirectionSettings& settings, WindowSamples& samples, Links& links);

}  // namespace lamina::normals
