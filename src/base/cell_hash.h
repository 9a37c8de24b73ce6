// One number for a cell's place, for tables of cells.
#pragma once
#include <cstddef>
#include <cstdint>

namespace lamina {

/// Odd multipliers spread neighbouring cells; the shift brings the well mixed upper bits down.
constexpr std::size_t cell_hash(std::int64_t x, std::int64_t y, std::int64_t z) {
  const std::uint64_t mixed = static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15U ^
                              static_cast<std::uint64_t>(y) * 0xC2B2AE3D27D4EB4FU ^
                              static_cast<std::uint64_t>(z) * 0x165667B19E3779F9U;
  return static_cast<std::size_t>(mixed ^ mixed >> 32);
}

}  // namespace lamina
