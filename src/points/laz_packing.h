// How the points of a LAZ file are compressed, from the record that LASzip puts into its header.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "laz/chunks.h"

namespace lamina {

struct LazPacking {
  static constexpr std::uint32_t kVariable = 0xFFFFFFFF;

  bool layered = false;            ///< formats 6 to 8
  bool chunked = true;             ///< else all points are one chunk, without a table
  std::uint32_t chunk_points = 0;  ///< in every chunk but the last; kVariable: the chunk table tells
  laz::RecordLayout layout;
};

/// By user and number of the record, in the list of variable length records.
inline constexpr const char* kLazUser = "laszip encoded";
inline constexpr std::uint16_t kLazRecord = 22204;

/// From the contents of the record, of points of the format and size. Throws Error(unreadable), beginning with `name`,
/// for what is not read: wave packets, coders of another kind, items that do not make such a point.
LazPacking parse_laz_packing(std::span<const std::byte> record, int point_format, std::size_t record_bytes,
                             const std::string& name);

/// The record, with its own header, for points of format 6 or 7 in chunks of `chunk_points`.
std::string laz_packing_record(int point_format, std::size_t record_bytes, std::uint32_t chunk_points);

}  // namespace lamina
