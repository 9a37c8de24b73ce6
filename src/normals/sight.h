// What can be seen from a patch to either side of it. A scanner stood on a side from which one looks far, and what it
// saw lies open to that side.
#pragma once
#include <cstdint>
#include <vector>

#include "normals/occupancy.h"
#include "normals/patch_graph.h"

namespace lamina::normals {

/// To one side of a patch.
struct View {
  float open = 1;  ///< share of the directions in which no other patch lies; also eighty degrees from the normal
  float way = 1;   ///< mean way to the next one within sixty degrees, of the cloud's diagonal; 1 where there is none

  /// But for a crack nothing of the open is seen.
  [[nodiscard]] bool is_closed() const { return open < 0.03F; }
};

/// Of a patch as its normals are.
struct Sight {
  View front, back;
};

/// Looks around from the patches that `wanted` says (by node). What lies nearer than about two cubes hides nothing: it
/// may be the patch's own surface. All is open where nothing is known of what patches hide.
std::vector<Sight> look_around(const PatchGraph& graph, const Occupancy& around,
                               const std::vector<std::uint8_t>& wanted);

}  // namespace lamina::normals
