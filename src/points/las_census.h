// What all points of a LAS have, read once before the points are.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "points/las_header.h"
#include "points/las_records.h"
#include "points/point_columns.h"

namespace lamina {

/// A standard value that is worth carrying only if some point has it.
struct LasCandidate {
  PointColumn column;
  double enough = 0;   ///< a size above decides all there is to know about it
  unsigned mask = 0;   ///< of the bits that count; 0: all
  double highest = 0;  ///< the largest size found

  [[nodiscard]] bool is_colour() const { return enough > 0; }
};

struct LasCensus {
  std::vector<LasCandidate> values;
  std::array<std::uint64_t, 256> classes{};  ///< how many points each has
};

/// Reads all records once: values until they are decided, in the first block mostly, and to the end where they are all
/// small. The candidates are intensity, colours and infrared, and with `fields` all of las_fields(), too.
LasCensus take_las_census(const LasRecords& records, const LasHeader& header, bool fields);

/// The bytes of a record that the columns take.
laz::WantedBytes las_bytes_of(const std::vector<PointColumn>& columns, std::size_t record_bytes);

}  // namespace lamina
