// Extension of a projected slab: every corner gets a sign and, where samples speak for it, a value. Doubtful corners
// are repaired from the tangent planes of their trusted neighbours rather than rejected (docs/method.md, "Trusted
// corners and extension"; Cuccuru et al. 2009, section 3.5).
#pragma once
#include <array>
#include <bit>
#include <cstdint>

#include "mls/kernel.h"
#include "octree/corner_block.h"
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

/// A layer of a block's corners that are in a mask (`seen` or a subset of it), and where their records begin.
struct RecordLayer {
  std::uint64_t wanted = 0, active = 0;
  const float* first = nullptr;  ///< record
  std::uint32_t channels = 0;

  RecordLayer() = default;
  RecordLayer(const CornerBlock* of, BlockMask Projected::*mask, int layer, int slab_layers) {
    if (of == nullptr) return;
    const CornerValues& values = of->values[static_cast<std::size_t>(layer / slab_layers)];
    if (values.count == 0) return;
    wanted = (of->*mask).words[layer];
    if (wanted == 0) return;
    active = of->active.words[layer];
    first = values.of(of->value_index(layer * 64, slab_layers));
    channels = values.channels;
  }
  [[nodiscard]] const float* record(int bit) const {
    const std::uint64_t before = active & ((std::uint64_t{1} << bit) - 1);
    return first + static_cast<std::size_t>(std::popcount(before)) * channels;
  }
};

/// The values of the corners around a corner: calls use(dx, dy, dz, record) for those of the 26 corners around one of a
/// block that are in a mask (`seen` or a subset of it) and have their values, in the order of for_neighbours().
template <typename Use>
void for_records_around(const CornerBlock& block, int offset, BlockMask Projected::*mask, int slab_layers,
                        const Use& use) {
  const int x = offset & 7;
  const int y = (offset >> 3) & 7;
  for (int dz = -1; dz <= 1; ++dz) {
    const int z = (offset >> 6) + dz;
    // Of the blocks at x and beside it; rows in one block share them.
    RecordLayer middle, aside;
    const int beyond = x == 0 ? -1 : 1;
    for (int dy = -1; dy <= 1; ++dy) {
      const int block_y = (y + dy) >> 3;
      const int row = 8 * ((y + dy) & 7);
      if (dy == -1 || (y + dy) == 0 || (y + dy) == 8) {
        middle = {block.around[CornerBlock::towards(0, block_y, z >> 3)], mask, z & 7, slab_layers};
        if (x == 0 || x == 7)
          aside = {block.around[CornerBlock::towards(beyond, block_y, z >> 3)], mask, z & 7, slab_layers};
      }
      const auto visit = [&](const RecordLayer& of, int from_x, unsigned three) {
        for (auto bits = static_cast<unsigned>(of.wanted >> row) & three; bits != 0; bits &= bits - 1) {
          const int at = std::countr_zero(bits);
          use(at + from_x - x, dy, dz, of.record(row + at));
        }
      };
      const unsigned three = dy == 0 && dz == 0 ? 0b101U : 0b111U;
      if (x == 0) visit(aside, -8, (three & 1U) << 7);
      visit(middle, 0, (x == 0 ? three >> 1 : three << (x - 1)) & 0xFFU);
      if (x == 7) visit(aside, 8, three >> 2);
    }
  }
}

}  // namespace lamina
