// What the way into the plane of a map and the way back have in common.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>

namespace lamina {

/// The ellipsoid as the series of Krueger (1912) in the third flattening have it, whose four terms are exact to less
/// than a millimetre as far as 3000 km from the middle meridian.
struct Krueger {
  double eccentricity, radius;     ///< of the ellipsoid; of the sphere whose meridians are as long
  std::array<double, 4> to, back;  ///< coefficients from the sphere to the plane and back

  /// `inverse_flattening`: 0 of a sphere.
  Krueger(double half_axis, double inverse_flattening) {
    const double f = inverse_flattening > 0 ? 1 / inverse_flattening : 0, n = f / (2 - f);
    const double n2 = n * n, n3 = n2 * n, n4 = n2 * n2;
    eccentricity = std::sqrt(f * (2 - f));
    radius = half_axis / (1 + n) * (1 + n2 / 4 + n4 / 64);
    to = {n / 2 - n2 * 2 / 3 + n3 * 5 / 16 + n4 * 41 / 180, n2 * 13 / 48 - n3 * 3 / 5 + n4 * 557 / 1440,
          n3 * 61 / 240 - n4 * 103 / 140, n4 * 49561 / 161280};
    back = {n / 2 - n2 * 2 / 3 + n3 * 37 / 96 - n4 / 360, n2 / 48 + n3 / 15 - n4 * 437 / 1440,
            n3 * 17 / 480 - n4 * 37 / 840, n4 * 4397 / 161280};
  }
};

/// Of well-known text what stands between `begin` and the bracket that closes the first behind it, both included;
/// empty where none does.
inline std::string_view bracketed(std::string_view text, std::size_t begin) {
  int depth = 0;
  for (std::size_t at = begin; at < text.size(); ++at) {
    if (text[at] == '[') ++depth;
    if (text[at] == ']' && --depth == 0) return text.substr(begin, at + 1 - begin);
  }
  return {};
}

}  // namespace lamina
