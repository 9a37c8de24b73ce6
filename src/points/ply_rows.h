// What the properties of a PLY's vertices are to us, and how they lie in a row.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/points.h"
#include "points/ply_header.h"
#include "points/point_columns.h"

namespace lamina {

/// The vertex element, understood.
struct PlyRows {
  std::size_t element = 0;           ///< its index in the header
  std::vector<PointColumn> columns;  ///< file order
  std::size_t stride = 0;            ///< bytes of a row in a binary file
  PointSourceInfo info;              ///< all but random_access
};

/// Finds the vertex element and gives its properties their roles. `path` is the user's, `name` the one for messages.
/// Throws Error(unreadable) when there is none, no x y z, an incomplete normal, a property twice or a list.
PlyRows understand_vertices(const PlyHeader& header, const std::string& path, const std::string& name);

/// "N rows are promised, M are there", worded the same for all formats.
[[noreturn]] void report_short_file(const std::string& name, const std::string& element, std::uint64_t promised,
                                    const std::string& held);

}  // namespace lamina
