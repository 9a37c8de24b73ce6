// Rows taken from the input or not, judged one by one.
#pragma once
#include "lamina/clip.h"

namespace lamina::clean {

enum class Pick : std::uint8_t { taken, skipped, clipped };

/// Of row i of a batch, whose number in the input is row.
inline Pick judge(const RowPick& pick, const SampleBatch& batch, std::size_t i, std::uint64_t row) {
  if (pick.every > 1 && row % pick.every != 0) return Pick::skipped;
  if (!pick.clip) return Pick::taken;
  const std::array<double, 3> p{batch.x[i], batch.y[i], batch.z[i]};
  for (std::size_t k = 0; k < 3; ++k) {
    // Not-a-number lies nowhere, and is somebody else's to count.
    if (p[k] < pick.clip->low[k] || p[k] > pick.clip->high[k]) return Pick::clipped;
  }
  return Pick::taken;
}

}  // namespace lamina::clean
