// What a point record of LAS holds between its intensity and its colours: returns, classes, angles, times.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/scalar_type.h"
#include "lamina/attributes.h"
#include "lamina/points.h"
#include "points/writers.h"

namespace lamina {

// What a point record of LAS holds between its intensity and its colours: returns, classes, angles, times.

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

struct LasExtraColumn {
  std::string name;
  ScalarType type = ScalarType::float32;
};

/// What the header says of all points.
struct LasTotals {
  std::uint64_t rows = 0;
  std::array<LasAxis, 3> axes{};
  std::array<std::uint64_t, 15> by_return{};  ///< points that are a pulse's first return, second, ...
  bool adjusted_times = false;                ///< some GPS time is none of a week
};

class LasLayout {
 public:
  /// Throws Error(internal) for names that do not fit.
  explicit LasLayout(const PointColumns& columns);

  [[nodiscard]] bool has_colours() const { return colours_; }
  [[nodiscard]] int point_format() const { return colours_ ? 7 : 6; }
  [[nodiscard]] std::size_t record_bytes() const { return record_bytes_; }
  /// Header and records before the points; `packing` is LAZ's record, empty for LAS.
  [[nodiscard]] std::string header(const LasTotals& totals, const std::string& packing) const;
  /// Adds the batch's returns and times. Throws Error(usage) naming `file` and a value that a record has no room for.
  void count(const SampleBatch& batch, const std::string& file, LasTotals& totals) const;
  /// The coordinate system to name before the points: well-known text, or EPSG:NUMBER, which becomes GeoTIFF keys (of
  /// degrees where it is `geographic`). Anything else has no place there.
  void name_system(const std::string& crs, bool geographic);
  /// Rows [first, first + n) as point records.
  void encode(const SampleBatch& batch, const std::array<LasAxis, 3>& axes, std::size_t first, std::size_t n,
              std::byte* out) const;

 private:
  /// An attribute that has its own place in a record.
  struct OwnPlace {
    LasField field;
    std::size_t attribute = 0;
  };

  void put_fields(const SampleBatch& batch, std::size_t row, std::byte* record) const;

  PointColumns columns_;
  std::vector<OwnPlace> fields_;  ///< of las_fields()
  bool colours_ = false;
  std::array<std::size_t, 3> colour_{};  ///< attributes red, green, blue
  int intensity_ = -1;                   ///< its attribute, -1: none
  std::vector<std::size_t> others_;      ///< attributes that are extra bytes
  std::vector<LasExtraColumn> extras_;   ///< all extra bytes
  std::size_t record_bytes_ = 0;
  std::string system_;       ///< the record of the coordinate system
  bool system_text_ = true;  ///< which is text, as these point formats ask for; else keys, which others read as well
};

}  // namespace lamina
