// Reads a corner's value out of the window: its own where it is trusted, else extended from trusted neighbours.
#pragma once
#include <array>
#include <vector>

#include "octree/window.h"

namespace lamina {

struct CornerValue {
  float distance = 0;             ///< signed, steps, positive outside
  std::array<float, 3> normal{};  ///< unit, at the projected point (corner - distance * normal)
  float curvature = 0;            ///< 1/steps
  float offset_from_mean = 0;     ///< |projected point - weighted average| / local support radius; 0 when extended
};

/// The value of a corner of a leaf cell (any corner in `corners` of its leaf) after its slab and the slabs around it
/// were projected. The finest level holding the corner decides, so the answer has the same bits from every level. False
/// when the corner has no trusted value, no trusted neighbour and is not `defined` for its own; `out` is then
/// untouched. `attributes` (may be null) gets window.attributes() floats.
bool corner_value(const Window& window, int level, const Cell& corner, CornerValue& out, float* attributes);

}  // namespace lamina
