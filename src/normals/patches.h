// Neighbouring samples grow together to patches of one sign: pieces of the surface within which links agree.
#pragma once
#include <array>
#include <cstdint>

#include "normals/patch_graph.h"
#include "normals/sample_window.h"
#include "normals/sight.h"
#include "samples/sample_tree.h"

namespace lamina::normals {

/// What two neighbours say about each other's sign, in -1..1: the cosine between one's normal and the other's mirrored
/// at the plane between them. On a sphere, around an edge and across a thin wall that tells the sign where the plain
/// cosine does not; `scale` keeps noise between very near samples from passing for a wall.
float agreement(const std::array<float, 3>& offset, const std::array<float, 3>& a, const std::array<float, 3>& b,
                float scale);

struct PatchSettings {
  std::int32_t cell = 1;    ///< steps: patches lie within cubes of this side, on its multiples
  int neighbours = 16;      ///< samples that lie within Links::scale
  bool given_stay = false;  ///< given normals keep their sign: they belong to the fixed node
};

/// The smallest side a cell can have: their numbers must fit 21 bits.
inline constexpr std::int32_t kLeastPatchCell = 1 << 11;

/// Groups the slab's samples (links.core) into patches, gives them nodes and the signs they have relative to these, and
/// adds the slab to the graph: nodes, edges to the patches of this and earlier slabs, links within. Samples without a
/// normal get no node.
void grow_patches(const SampleTree& tree, const PatchSettings& settings, const Viewpoints& viewpoints,
                  const Links& links, WindowSamples& samples, PatchGraph& graph);

}  // namespace lamina::normals
