// The colour of procedural shapes.
#pragma once
#include <array>

#include "scatter/waves.h"

namespace lamina::scatter_detail {

/// A smooth pattern of the position, 27.5 to 227.5 in each channel; |gradient| at most 1100 per unit of length.
inline std::array<float, 3> shape_colour(const std::array<double, 3>& p) {
  const auto channel = [](double t) { return static_cast<float>(127.5 + 100 * parabolic_wave(t).value); };
  return {channel(0.9 * p[0] + 0.4 * p[1]), channel(0.8 * p[1] - 0.5 * p[2] + 0.25),
          channel(0.7 * p[2] + 0.6 * p[0] + 0.6)};
}

}  // namespace lamina::scatter_detail
