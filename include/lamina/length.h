// Lengths as a user writes them: in the input's units or in multiples of a sample's radius.
#pragma once
#include <string>
#include <string_view>

namespace lamina {

/// `0.01` is a length in the input's units, `0.6r` is 0.6 sample radii, `0.9R` is 0.9 influence radii (METHOD: R = H
/// r).
struct Length {
  enum class Unit { world, sample_radius, influence_radius };
  double value = 0;  ///< finite, >= 0
  Unit unit = Unit::world;
  bool operator==(const Length&) const = default;
};

/// Reads a number with an optional `r` or `R` behind it; the decimal point is a point in every locale.
/// Throws Error(usage) saying what a length looks like.
Length parse_length(std::string_view text);

/// Writes a length so that parse_length() reads the same value.
std::string to_string(const Length& length);

/// The length in the input's units, for a sample of the given radius under the given blending factor H.
double resolve(const Length& length, double sample_radius, double blend);

}  // namespace lamina
