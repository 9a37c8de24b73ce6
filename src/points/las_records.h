// Variable length records of LAS files: what they say of the coordinates' kind and of extra bytes; others are skipped.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "points/las_header.h"

namespace lamina {

struct LasRecords {
  enum class Coordinates { unknown, projected, geographic };
  Coordinates coordinates = Coordinates::unknown;
  std::vector<std::byte> extra_bytes;  ///< descriptors of 192 bytes each
};

/// The `count` records from `offset` on, as far as they end before `end`; a damaged list ends where it stops making
/// sense, as no point depends on it.
void read_las_records(const InputFile& file, std::uint64_t offset, std::uint32_t count, std::uint64_t end,
                      LasRecords& records);
/// The same for those behind the points, which may be longer than 64 kB.
void read_las_extended_records(const InputFile& file, std::uint64_t offset, std::uint32_t count, LasRecords& records);

/// Where the described extra values lie in a record of `record_bytes` with `standard_bytes` before them. Arrays,
/// integers of 64 bits and undocumented bytes are passed over.
std::vector<LasExtra> place_extras(const LasRecords& records, std::size_t standard_bytes, std::size_t record_bytes);

}  // namespace lamina
