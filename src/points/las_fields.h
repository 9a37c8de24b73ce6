// What a point record of LAS holds between its intensity and its colours: returns, classes, angles, times.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "base/scalar_type.h"
#include "lamina/attributes.h"

namespace lamina {

struct LasField {
  std::string_view name;   ///< as an attribute
  ScalarType stored{};     ///< in the record
  std::size_t offset = 0;  ///< in the record, bytes
  unsigned shift = 0;      ///< where its bits begin
  unsigned bits = 0;       ///< how many; 0: all of `stored`
  double scale = 1;        ///< from the record to the attribute

  /// As a double that was read from the record's bytes stands for it.
  [[nodiscard]] double value(double stored_value) const {
    if (bits == 0) return stored_value * scale;
    return static_cast<double>(static_cast<unsigned>(stored_value) >> shift & ((1U << bits) - 1));
  }
  [[nodiscard]] bool is_stored_as_it_is() const { return bits == 0 && scale == 1; }
  /// Of the attribute.
  [[nodiscard]] ScalarType type() const { return scale == 1 ? stored : ScalarType::float32; }
};

/// Those of the point format, in the record's order. They are, by name: return_number, number_of_returns, class_flags
/// (1 synthetic, 2 key point, 4 withheld, 8 overlap), scanner_channel, scan_direction, edge_of_flight_line,
/// classification, user_data, scan_angle (degrees), point_source, gps_time.
std::vector<LasField> las_fields(int point_format);

/// Longest time of a week, seconds: larger ones are none of a week but adjusted GPS time.
inline constexpr double kSecondsOfWeek = 604800;

}  // namespace lamina
