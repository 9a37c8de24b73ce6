// Periodic functions built from exact arithmetic alone, so that a procedural shape has the same bits on every machine
// (the C library's sine may differ in the last bit between processors).
#pragma once
#include <cmath>

namespace lamina::scatter_detail {

struct SinCos {
  double sine, cosine;
};

/// sin and cos of 2 pi t, within 3e-14 for |t| < 2^40.
inline SinCos sincos_turns(double t) {
  // To the nearest eighth of a turn, then Taylor polynomials on [-pi/4, pi/4].
  const double quarters = std::floor(4 * t + 0.5);
  const double y = 6.283185307179586476925 * (t - 0.25 * quarters);
  const double z = y * y;
  const double s =
      y * (1 + z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 +
                                                     z * (1.0 / 362880 + z * (-1.0 / 39916800 + z / 6227020800.0))))));
  const double c =
      1 + z * (-0.5 + z * (1.0 / 24 +
                           z * (-1.0 / 720 +
                                z * (1.0 / 40320 + z * (-1.0 / 3628800 + z * (1.0 / 479001600 - z / 87178291200.0))))));
  switch (static_cast<long long>(quarters) & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

struct Wave {
  double value, slope;
};

/// A wave of period 1 made of two parabolas: between -1 and 1, its slope continuous, its curvature jumping at the
/// zeros.
inline Wave parabolic_wave(double t) {
  const double u = t - std::floor(t + 0.5);
  const double a = std::fabs(u);
  return {8 * u * (1 - 2 * a), 8 - 32 * a};
}

}  // namespace lamina::scatter_detail
