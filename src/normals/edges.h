// Directions beside sharp edges. The plane of the nearest samples holds both sides of an edge and leans half-way
// between them; where noise is little beside the samples' distance, most of a larger neighbourhood tells the sample's
// own side.
#pragma once
#include <vector>

#include "normals/sample_window.h"
#include "samples/sample_tree.h"

namespace lamina::normals {

/// A plane that holds an edge has so many times the deviation of those around, as far as they know what noise there is,
inline constexpr float kEdgeDeviation = 3;
/// and such a share of its reach, the distance of its farthest sample: at a right angle 0.2, and what is round less.
inline constexpr float kSharp = 0.08F;
/// So many deviations of noise from a plane samples still lie on it:
inline constexpr float kOnSide = 5;
/// no larger share of the reach, or the sides could not be told apart by what is left,
inline constexpr float kMostOnSide = 0.15F;
/// and no smaller one: normals beside edges of clean clouds are found while the surface is (RefitNormals).
inline constexpr float kLeastOnSide = 0.02F;

/// The planes that samples got first, of their nearest samples.
struct FirstPlanes {
  std::vector<float> variance;  ///< across the plane, by place, steps^2; below 0: none is known
  std::vector<float> reach;     ///< squared, by number of the core sample, steps^2; 0: it has none
};

/// Replaces the normals of core samples whose first plane holds an edge by that of the plane that most samples around
/// lie on (samples/consensus_plane.h); such a sample is on its sheet.
void sharpen_edges(const SampleTree& tree, const FirstPlanes& planes, const Links& links, WindowSamples& samples);

}  // namespace lamina::normals
