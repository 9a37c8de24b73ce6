// The graph of patches, pieces of the surface within which the signs of normals are settled: what neighbouring ones say
// about each other, and the signs that follow.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lamina/normals.h"

namespace lamina::normals {

/// Sums over a patch's samples, signs relative to the patch. Lengths in kUnit steps of the frame.
struct PatchNode {
  static constexpr double kUnit = 1 << 29;
  std::uint32_t count = 0;
  float area = 0;                  ///< kUnit^2
  std::array<float, 3> centre{};   ///< by area
  std::array<float, 3> outward{};  ///< normals, by area
  float bulge = 0;                 ///< normal times offset from the centre, by area
  float vote = 0;                  ///< cosines to the viewpoints
};

/// What the links between two patches come to.
struct PatchEdge {
  std::uint32_t a = 0, b = 0;            ///< a < b
  float agreement = 0;                   ///< sum over links; below 0: one of the two must turn
  std::uint32_t same = 0, opposite = 0;  ///< links along the surface, by their normals as they are
};

/// Links of a slab whose signs no patch decides.
struct SlabLinks {
  std::uint64_t same = 0, opposite = 0;
  std::size_t edge_end = 0;  ///< the slab's edges end there
};

struct PatchGraph {
  float cell = 0;  ///< side of the cubes that patches lie in, kUnit steps; 0: nothing is known of what they hide
  std::vector<PatchNode> nodes = std::vector<PatchNode>(1);  ///< the first is kFixed: it cannot turn
  std::vector<PatchEdge> edges;
  std::vector<SlabLinks> slabs;
};

/// How a patch's sign was found.
enum class SignSource : std::uint8_t {
  fixed,    ///< linked to the fixed node, by votes or by given normals
  outside,  ///< the surface encloses a volume
  inside,   ///< the same, but what is in it was seen from inside
  up,       ///< ground of a wide and flat cloud
  sight,    ///< one looks farther from this side
  unsure,   ///< too open, or encloses little
};

/// The input's x, y and z in the frame, unit length.
using InputAxes = std::array<std::array<float, 3>, 3>;

struct PatchSigns {
  std::vector<std::int8_t> sign;  ///< by node: 1 or -1
  std::vector<SignSource> source;
  std::uint64_t components = 0;
};

/// Chooses signs so that as many links as possible agree: a spanning tree in Boruvka's rounds, where every cluster of
/// patches joins the one that it has most to say about, for or against, and the sums are taken anew between the
/// clusters. Votes are links to the fixed node. Clusters whose links contradict each other too much to follow wait
/// until those that enclose a volume have been turned outside out, or inside out if it is a room. What then still is
/// not joined to the fixed node gets its side by itself (Sides). Deterministic.
PatchSigns find_signs(const PatchGraph& graph, const InputAxes& axes);

/// Conflicts that remain, by slab.
std::vector<SignConflicts> count_conflicts(const PatchGraph& graph, const PatchSigns& signs);

}  // namespace lamina::normals
