// What the XML section of an E57 file says of its scans.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "e57/paged_file.h"

namespace lamina::e57 {

/// A value of every record, in a stream of its own.
struct Field {
  enum class Kind : std::uint8_t { integer, scaled_integer, single_float, double_float, text };
  std::string name;  ///< with the prefix of its extension, as in nor:normalX
  Kind kind = Kind::double_float;
  std::int64_t minimum = INT64_MIN, maximum = INT64_MAX;  ///< of integers, before they are scaled
  double scale = 1, offset = 0;                           ///< value = scale * integer + offset
  /// Of a value in the stream: as many as the largest integer above the minimum has.
  [[nodiscard]] unsigned bits() const;
};

using Limits = std::optional<std::pair<double, double>>;

struct Scan {
  std::uint64_t section = 0;  ///< payload offset of its records
  std::uint64_t records = 0;
  std::vector<Field> fields;
  bool has_pose = false;
  bool has_rotation = false;
  std::array<double, 4> rotation{1, 0, 0, 0};  ///< unit quaternion w x y z
  std::array<double, 3> translation{};
  Limits intensity;
  std::array<Limits, 3> colour;  ///< red green blue
};

struct Contents {
  std::string coordinate_metadata;  ///< the coordinate system, mostly as well-known text
  std::vector<Scan> scans;
  std::uint64_t images = 0;
};

/// Throws Error(unreadable) naming the line of the XML section where it is malformed.
Contents read_contents(const PagedFile& file);

}  // namespace lamina::e57
