// The elements of a PLY as points: what its vertices' properties are to us, where the rows lie in a binary file, and
// the grid of a range image.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lamina/points.h"
#include "points/input_file.h"
#include "points/ply_header.h"
#include "points/point_columns.h"
#include "points/scans.h"

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

/// True when the format's byte order is not this machine's.
bool is_swapped(PlyFormat format);

/// Offset of the first row of element `wanted`. Elements without lists are skipped by arithmetic, lists are walked once
/// through a small buffer. Checks every element, and that nothing but blanks follows the last one.
/// Throws Error(unreadable) naming the element, with the rows promised and held.
std::uint64_t locate_element(const InputFile& file, const PlyHeader& header, std::size_t wanted);

/// The range grid of Stanford's range images: an element with a list for each place, empty or with its vertex.
/// Null where the file has none, or one that cannot be used: its vertices are not those of the file in their order, or
/// the header does not tell its width (obj_info num_cols). Elements are as the header promises, or end the walk.
std::shared_ptr<const ScanGrid> read_range_grid(const InputFile& file, const PlyHeader& header);

}  // namespace lamina
