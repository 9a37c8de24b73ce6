// Lengths as a user writes them: in the input's units or in multiples of a sample's radius.
#pragma once
#include <string>
#include <string_view>

namespace lamina {

/// `0.01` is a length in the input's units, `0.6r` is 0.6 sample radii r, and `0.9R` is 0.9 influence radii R = H r
/// with the blending factor H (Cuccuru et al. 2009, section 3.2).
struct Length {
  enum class Unit { world, sample_radius, influence_radius };
  double value = 0;  ///< finite, >= 0
  Unit unit = Unit::world;
  bool operator==(const Length&) const = default;
};

/// Reads a number >= 0 with an optional `r` or `R` behind it; the decimal separator is a point in every locale.
/// Throws Error(usage) that says what a length looks like.
Length parse_length(std::string_view text);

/// The shortest text that parse_length() reads as the same value.
std::string to_string(const Length& length);

/// The length in the input's units for a sample of radius `sample_radius` (input units) and the blending factor
/// `blend`.
double resolve(const Length& length, double sample_radius, double blend);

}  // namespace lamina
