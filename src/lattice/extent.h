// Where a cloud lies on the lattice.
#pragma once
#include <cstdint>

namespace lamina {

/// Cross-section of the cloud in fixed-point steps, inclusive.
struct Bounds {
  std::int32_t x_min = 0, x_max = -1, y_min = 0, y_max = -1;
};

/// Where the samples lie, fixed-point, inclusive.
struct Extent : Bounds {
  std::int32_t z_min = 0, z_max = -1;
};

}  // namespace lamina
