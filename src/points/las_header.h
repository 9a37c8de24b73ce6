// The public header block of a LAS file (ASPRS, "LAS Specification", versions 1.0 to 1.4 R15) and what its variable
// length records say of coordinates, extra bytes and compression.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "points/input_file.h"
#include "points/laz_packing.h"

namespace lamina {

/// A value some program put behind the standard ones of every point.
struct LasExtra {
  std::string name;  ///< usual_name()
  ScalarType type = ScalarType::float32;
  std::size_t offset = 0;  ///< in the point record
  double scale = 1, shift = 0;
};

struct LasHeader {
  int minor = 0;         ///< version 1.minor
  int point_format = 0;  ///< 0 to 10
  std::size_t record_bytes = 0;
  std::uint64_t count = 0;
  std::uint64_t data = 0;       ///< offset of the first point
  std::uint64_t uncounted = 0;  ///< points for which there is room behind those that are counted
  std::array<double, 3> scale{}, offset{};
  std::array<double, 3> low{}, high{};  ///< bounding box as the header gives it
  bool geographic = false;              ///< x and y are degrees
  bool several_returns = false;         ///< some pulses have more than one, by the header's counts
  std::string crs;                      ///< PointSourceInfo::crs
  std::vector<LasExtra> extras;         ///< of one value each, of a type this library has
  std::optional<LazPacking> packing;    ///< of LAZ files
  std::vector<std::byte> octree;        ///< the record of a COPC file (parse_copc())
};

/// Throws Error(unreadable) for what no version allows: sizes too small, an unknown point format, a scale of 0, more
/// points than the file has room for; for a count of 0 before points, which a writer leaves that was stopped; and for
/// LAZ that is compressed in a way not known here.
LasHeader read_las_header(const InputFile& file);

/// Bytes of the standard values of a point format, 0 to 10.
std::size_t las_record_bytes(int point_format);
/// Offset of red in a record, 0 for formats without colours; green and blue follow, each of 16 bits.
std::size_t las_colour_offset(int point_format);

}  // namespace lamina
