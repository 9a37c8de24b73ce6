// Extension of a projected slab: every corner gets a sign and, where samples speak for it, a value. Doubtful corners
// are repaired from the tangent planes of their trusted neighbours rather than rejected (docs/method.md, "Trusted
// corners and extension"; Cuccuru et al. 2009, section 3.5).
#pragma once
#include <array>
#include <cstdint>

#include "mls/kernel.h"
#include "octree/window.h"

namespace lamina {

/// A doubtful corner without a trusted neighbour keeps its own value while its fit's projected point lies no farther
/// than this from the average of its samples (support radii): a poor value is better than none.
inline constexpr float kOwnOffset = 0.7F;

/// Without samples of its own a corner is supported while the weighted mean of its trusted neighbours lies this near
/// (cells, measured along the surface): it then lies over a small gap between samples and not beyond a boundary. That
/// of half of the neighbours in a plane is 0.4 away, of one side's 1.
inline constexpr float kSurrounded = 0.3F;

/// Sets `outside` of the slab's corners: the sign of their own trusted distance, else of the distance extended from
/// trusted neighbours, else of their own untrusted one, else outside; and `defined`, which leaves out the last kind
/// and corners whose own projected point lies farther than `boundary` local support radii from the average of its
/// samples (Adamson & Alexa 2004; 0: no limit); and `supported`. A corner that a finer level holds takes that level's
/// bits. The slabs below and above must be projected.
void extend_slab(Window& window, std::int32_t slab, const Kernel& kernel, float boundary);

struct CornerValue {
  float distance = 0;             ///< signed, steps, positive outside
  std::array<float, 3> normal{};  ///< unit, at the projected point (corner - distance * normal); zero where extended
                                  ///< normals cancel
  float curvature = 0;            ///< 1/steps
  float offset_from_mean = 0;     ///< |projected point - weighted average| / local support radius; 0 when extended
  [[nodiscard]] bool has_normal() const { return normal != std::array<float, 3>{}; }
};

/// The value of a corner of a leaf cell (any corner in `corners` of its leaf) after its slab and the slabs around it
/// were projected: its own where it is trusted, else extended from trusted neighbours by the rule and with the bits of
/// extend_slab(), so that its sign is the corner's. The finest level holding the corner decides, so the answer has the
/// same bits from every level. False when the corner has no trusted value, no trusted neighbour and is not `defined`
/// for its own; `out` is then untouched. `attributes` (may be null) gets window.attributes() floats.
bool corner_value(const Window& window, int level, const Cell& corner, CornerValue& out, float* attributes);

}  // namespace lamina
