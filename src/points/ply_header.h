// The header of a PLY file (Turk, "The PLY Polygon File Format", 1994; the sized type names are rply's).
#pragma once
#include <cstdint>
#include <optional>
#include <streambuf>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/attributes.h"
#include "points/input_file.h"

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

/// A comment's text: line breaks and other control characters become blanks.
std::string one_line(std::string text);

}  // namespace lamina
