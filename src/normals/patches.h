// Neighbouring samples grow together to patches of one sign.
#pragma once
#include <cstdint>

#include "normals/patch_graph.h"
#include "normals/sample_tree.h"
#include "normals/viewpoints.h"
#include "normals/window_samples.h"

namespace lamina::normals {

struct PatchSettings {
  std::int32_t cell = 1;    ///< steps: patches lie within cubes of this side, on its multiples
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
