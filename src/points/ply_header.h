// The header of a PLY file (Turk, "The PLY Polygon File Format", 1994; the sized type names are rply's).
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <streambuf>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/points.h"
#include "points/input_file.h"
#include "points/point_columns.h"
#include "points/scans.h"

namespace lamina {

enum class PlyFormat { ascii, little_endian, big_endian };

struct PlyProperty {
  std::string name;
  ScalarType type = ScalarType::float32;  ///< of the value, or of a list's entries
  std::optional<ScalarType> list_count;   ///< a list: the type of its length
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;

  [[nodiscard]] std::optional<std::size_t> find(std::string_view property) const;  ///< the first of that name
  [[nodiscard]] bool has_list() const;
  [[nodiscard]] std::size_t row_bytes() const;  ///< in a binary file; only of elements without lists
};

struct PlyHeader {
  PlyFormat format = PlyFormat::ascii;
  std::vector<PlyElement> elements;
  std::uint64_t bytes = 0;  ///< where the data begins
  std::uint64_t lines = 0;  ///< lines of the header
  std::string crs;          ///< of a comment `crs ...` (PointSourceInfo::crs)
  char line_end = '\n';     ///< '\n' (also for CRLF) or '\r'
};

/// Reads the header from the beginning of the file; it must end within the first megabyte.
/// Throws Error(unreadable) naming file and line. Counts are as promised: nothing is checked against the file's size.
PlyHeader read_ply_header(const InputFile& file);

/// The same from a stream, of which nothing beyond the header is taken.
PlyHeader read_ply_header(std::streambuf& stream, const std::string& name);

/// The same from text that holds the whole header.
PlyHeader parse_ply_header(std::string_view text, const std::string& name);

/// For writers: throws Error(internal) when a name besides x y z nx ny nz is empty, has blanks, or is there twice.
/// `noun`: what has the names.
void require_ply_names(std::string_view noun, const std::vector<std::string_view>& names);

/// Line breaks and other control characters become blanks.
std::string one_line(std::string text);

/// A comment as a header has it, with its line's end. A long text, as a coordinate reference system is, goes on in
/// further lines, `comment + ...`: rply, by which Open3D and CloudCompare read, takes no line of 1024 bytes, others
/// hold fewer.
std::string ply_comment(std::string_view text);

// The elements of a PLY as points: what its vertices' properties are to us, where the rows lie in a binary file, and
// the grid of a range image.

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
