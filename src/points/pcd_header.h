// The header of a PCD file (Point Cloud Library, "The PCD file format", version .7).
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/attributes.h"

namespace lamina {

enum class PcdData { ascii, binary, binary_compressed };

struct PcdField {
  std::string name;                ///< usual_name()
  std::optional<ScalarType> type;  ///< none: integers of 64 bits
  std::size_t bytes = 4;           ///< of a value
  std::size_t count = 1;           ///< values a point has
};

struct PcdHeader {
  std::vector<PcdField> fields;
  std::uint64_t points = 0;
  PcdData data = PcdData::ascii;
  std::uint64_t bytes = 0;     ///< where the data begin
  std::uint64_t lines = 0;     ///< lines of the header
  std::uint64_t width = 0;     ///< of an organised cloud: points in a line; 0: not organised
  bool has_viewpoint = false;  ///< a VIEWPOINT other than 0 0 0 1 0 0 0
  bool is_moved = false;       ///< its place is another one than 0 0 0

  [[nodiscard]] std::size_t point_bytes() const;  ///< in binary data
};

/// A field of four bytes that packs a colour: rgb or rgba.
bool is_packed(const PcdField& field);
/// Bytes 0, 1, 2 and, of rgba, 3 of a packed colour.
inline constexpr std::array<const char*, 4> kPcdChannels{"blue", "green", "red", "alpha"};
std::size_t pcd_channels(const PcdField& field);

/// Throws Error(unreadable) naming file and line. The number of points is as promised: nothing is checked against the
/// file's size.
PcdHeader parse_pcd_header(std::string_view text, const std::string& name);

}  // namespace lamina
