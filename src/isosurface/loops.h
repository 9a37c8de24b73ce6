// Loops of isovertices around a cell: from the sign changes along its faces to cycles, and from a cycle to triangles.
// The rule is one of signs and of the face alone, so the two cells at a face draw the same lines on it; cells none of
// whose neighbours is subdivided take its results from a table.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace lamina {

/// Sides of a cell's face (axis, end) walked counter-clockwise seen from outside, in the face's axes u = axis + 1 and
/// v = axis + 2 (cyclic).
struct FaceSide {
  int along;     ///< 0: the side runs along u, 1: along v
  int at;        ///< 0 or 1: where it lies on the other axis
  bool forward;  ///< walked upwards
};
inline constexpr std::array<std::array<FaceSide, 4>, 2> kFaceSides = {{
    {{{1, 0, true}, {0, 1, true}, {1, 1, false}, {0, 0, false}}},  // the low end
    {{{0, 0, true}, {1, 1, true}, {0, 1, false}, {1, 0, false}}},  // the high end
}};

/// Name and rank of an isovertex inside a cell: its edge's midpoint relative to the cell, in half finest cells.
constexpr std::uint64_t loop_key(int x, int y, int z) {
  return (static_cast<std::uint64_t>(z) << 32) | (static_cast<std::uint64_t>(y) << 16) | static_cast<std::uint64_t>(x);
}

/// A sign change met on the way around a face.
struct FaceCrossing {
  std::uint64_t key = 0;
  bool rising = false;  ///< from inside to outside in walking direction
};

/// Links the crossings of a cell's faces and reads off the cycles. Reused from cell to cell.
class LoopTracer {
 public:
  struct Loop {
    std::uint32_t first = 0, count = 0;  ///< range of order()
    bool closed = false;                 ///< false: a face of it could not be resolved
  };

  void clear();
  /// The crossings of one undivided (part of a) face, in walking order: every rising one is linked with the next, so an
  /// ambiguous face cuts off its outside runs.
  void add_face(std::span<const FaceCrossing> cycle);
  /// Crossings of a face whose signs are not all known: no links.
  void add_unresolved(std::span<const FaceCrossing> cycle);
  /// Finds the loops: open chains first, then the cycles in order of their smallest keys, each beginning with it.
  void trace();

  [[nodiscard]] const std::vector<std::uint64_t>& keys() const { return keys_; }  ///< distinct, ascending
  [[nodiscard]] const std::vector<Loop>& loops() const { return loops_; }
  [[nodiscard]] const std::vector<std::uint32_t>& order() const { return order_; }  ///< indices into keys()

 private:
  std::vector<std::uint64_t> keys_;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> links_;  ///< from, to
  std::vector<std::uint32_t> order_, next_;
  std::vector<std::uint8_t> has_previous_, visited_;
  std::vector<Loop> loops_;
};

struct LoopPoint {
  std::array<float, 3> position{};
  std::uint8_t faces = 0;  ///< of the cell's six closed faces, those that contain the point: bit 2 axis + end
};

/// Longest loop that is cut by chords; the effort grows with its cube.
inline constexpr std::size_t kMaxChordLoop = 24;

/// Triangulates a loop of at least three points with the shortest chords, none of which lies in a face of the cell
/// (where the neighbour's could meet it). Appends indices into `loop`. False when there is no such way or the loop is
/// longer than kMaxChordLoop: it wants a centre.
bool cut_loop(std::span<const LoopPoint> loop, std::vector<std::array<std::uint8_t, 3>>& triangles);

/// Where the vertices of a loop go when they are clustered.
struct LoopSeat {
  std::array<float, 3> position{};
  std::array<float, 3> normal{};
  bool crease = false;  ///< on a sharp edge: it may have triangles that face any way
};

/// cut_loop() where sharp edges pass the cell: of all triangulations without chords in a face the one whose triangles
/// keep most to the normals of their seats that lie on no edge, so that an edge is not cut across.
bool cut_loop_along_creases(std::span<const LoopPoint> loop, std::span<const LoopSeat> seats,
                            std::vector<std::array<std::uint8_t, 3>>& triangles);

/// Corner i of a cell lies at (i & 1, (i >> 1) & 1, i >> 2); edge e runs along axis e / 4 from the corner whose
/// coordinates on axes axis + 1 and axis + 2 (cyclic) are the two bits of e % 4.
struct CaseTriangles {
  static constexpr int kMost = 5;
  std::uint8_t count = 0;                       ///< triangles
  std::array<std::uint8_t, 3 * kMost> edges{};  ///< three a triangle, counter-clockwise seen from outside
  /// The loops that the triangles fill, in their order: a loop of n edges has n - 2 of them.
  std::uint8_t loops = 0;
  std::array<std::uint8_t, 4> loop_size{};
  std::array<std::uint8_t, 12> loop_edges{};  ///< one loop after the other
};

constexpr std::array<int, 3> edge_low_corner(int edge) {
  std::array<int, 3> low{};
  const int axis = edge / 4;
  low[(axis + 1) % 3] = edge & 1;
  low[(axis + 2) % 3] = (edge >> 1) & 1;
  return low;
}

/// The middle of an edge, lengths in cells.
LoopPoint edge_middle(int edge);

/// Indexed by the mask of outside corners; made from the same face rule as every other cell (LoopTracer).
const std::array<CaseTriangles, 256>& case_table();

}  // namespace lamina
