// Triangles of a cell none of whose neighbours is subdivided, by the signs of its corners.
#pragma once
#include <array>
#include <cstdint>

namespace lamina {

/// Corner i of a cell lies at (i & 1, (i >> 1) & 1, i >> 2); edge e runs along axis e / 4 from the corner whose
/// coordinates on axes axis + 1 and axis + 2 (cyclic) are the two bits of e % 4.
struct CaseTriangles {
  static constexpr int kMost = 5;
  std::uint8_t count = 0;                       ///< triangles
  std::array<std::uint8_t, 3 * kMost> edges{};  ///< three a triangle, counter-clockwise seen from outside
};

constexpr std::array<int, 3> edge_low_corner(int edge) {
  std::array<int, 3> low{};
  const int axis = edge / 4;
  low[(axis + 1) % 3] = edge & 1;
  low[(axis + 2) % 3] = (edge >> 1) & 1;
  return low;
}

/// Indexed by the mask of outside corners; made from the same face rule as every other cell (LoopTracer).
const std::array<CaseTriangles, 256>& case_table();

}  // namespace lamina
