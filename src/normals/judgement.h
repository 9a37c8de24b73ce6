// What neighbouring samples say about each other's sign, link by link.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "normals/sample_window.h"
#include "samples/sample_tree.h"

namespace lamina::normals {

/// What a sample's links say of normals as they were found; besides, a bit for each link.
struct Judgement {
  /// In -1..1: the cosine between one's normal and the other's mirrored at the plane between them. On a sphere, around
  /// an edge and across a thin wall that tells the sign where the plain cosine does not; Links::scale keeps noise
  /// between very near samples from passing for a wall.
  std::array<float, Links::kMost> agreement{};
  /// The two lie beside each other on one surface, so that opposite normals contradict each other: across a thin wall
  /// and around an edge they do not.
  std::uint8_t along = 0;
  std::uint8_t same = 0;  ///< normals point to one side
};

/// Of sample links.core[i], between the sheets that the samples belong to (WindowSamples::lift).
Judgement judge_links(const SampleTree& tree, const WindowSamples& samples, const Links& links, std::size_t i);

}  // namespace lamina::normals
