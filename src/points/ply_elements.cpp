#include "points/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <optional>
#include <string>
#include <string_view>

#include "base/number.h"
#include "lamina/error.h"
#include "points/formats.h"
#include "points/input_file.h"
#include "points/text_rows.h"

namespace lamina {
namespace {

[[noreturn]] void unreadable(const std::string& name, const std::string& what) {
  throw Error(ExitCode::unreadable, fmt::format("{}: {}", name, what));
}

std::size_t vertex_element(const PlyHeader& header, const std::string& name) {
  std::size_t found = header.elements.size();
  std::string others;
  for (std::size_t i = 0; i < header.elements.size(); ++i) {
    if (header.elements[i].name == "vertex") {
      found = i;
    } else if (i < 8) {
      others += (others.empty() ? "" : ", ") + quoted_word(header.elements[i].name);
    }
  }
  if (found == header.elements.size()) {
    unreadable(name, fmt::format("the header has no element 'vertex'; its elements are: {}",
                                 others.empty() ? "none" : others));
  }
  return found;
}

void require_scalars(const PlyElement& vertices, const std::string& name) {
  for (const PlyProperty& property : vertices.properties) {
    if (property.list_count) {
      unreadable(name, fmt::format("property {} of the vertices is a list; points with lists are not read; write the "
                                   "file again without it (MeshLab does)",
                                   quoted_word(property.name)));
    }
  }
}

std::uint64_t end_of_fixed(const InputFile& file, const PlyElement& element, std::uint64_t offset) {
  const std::size_t stride = element.row_bytes();
  const std::uint64_t left = file.bytes - offset;
  if (stride != 0 && element.count > left / stride) {
    report_short_file(file.name, element.name, element.count,
                      fmt::format("{} of {} bytes each", left / stride, stride));
  }
  return offset + element.count * stride;
}

std::uint64_t end_of_lists(const InputFile& file, const PlyElement& element, bool swapped, std::uint64_t offset) {
  ByteCursor cursor(file, offset);
  for (std::uint64_t row = 0; row < element.count; ++row) {
    for (const PlyProperty& property : element.properties) {
      long long entries = 1;
      if (property.list_count) {
        const std::byte* length = cursor.take(static_cast<std::size_t>(byte_size(*property.list_count)));
        if (length == nullptr) report_short_file(file.name, element.name, element.count, std::to_string(row));
        entries = static_cast<long long>(load_scalar(*property.list_count, swapped, length));
        if (entries < 0) {
          throw Error(ExitCode::unreadable,
                      fmt::format("{}: element {}, row {}: list {} has the length {}: the file is damaged", file.name,
                                  quoted_word(element.name), row, quoted_word(property.name), entries));
        }
      }
      // A length has at most 32 bits, so the product fits.
      if (!cursor.skip(static_cast<std::uint64_t>(entries) * static_cast<std::uint64_t>(byte_size(property.type)))) {
        report_short_file(file.name, element.name, element.count, std::to_string(row));
      }
    }
  }
  return cursor.offset();
}

void require_end(const InputFile& file, std::uint64_t offset) {
  constexpr std::uint64_t kMostBlanks = 4096;
  const std::uint64_t left = file.bytes - offset;
  std::string rest(static_cast<std::size_t>(std::min(left, kMostBlanks)), '\0');
  rest.resize(file.read(offset, rest.data(), rest.size()));
  if (left > kMostBlanks || rest.find_first_not_of(" \t\r\n") != std::string::npos) {
    throw Error(ExitCode::unreadable, fmt::format("{}: {} bytes follow the last row the header promises (at byte {}): "
                                                  "a count or a property in the header is wrong",
                                                  file.name, left, offset));
  }
}

/// What a line of the header that begins with `key` says.
std::optional<std::uint64_t> number_after(std::string_view text, std::string_view key) {
  const std::size_t at = text.find(key);
  if (at == std::string_view::npos) return {};
  const char* p = text.data() + at + key.size();
  const char* const end = text.data() + text.size();
  while (p != end && *p == ' ') ++p;
  double value = 0;
  constexpr double kMost = 1 << 24;
  if (parse_number(p, end, value) == nullptr || !(value >= 2 && value <= kMost)) return {};
  return static_cast<std::uint64_t>(value);
}

/// Takes the places one by one, and finds out whether they can be used.
class GridFiller {
 public:
  GridFiller(std::uint64_t length, std::uint64_t vertices)
      : grid_(std::make_shared<ScanGrid>(length)), left_(vertices) {}
  /// `vertex`: of a filled place. False when the grid cannot be used.
  bool add(std::optional<long long> vertex) {
    if (vertex && (left_ == 0 || *vertex != static_cast<long long>(grid_->rows()))) return false;
    if (vertex) --left_;
    grid_->add(vertex.has_value());
    return true;
  }
  [[nodiscard]] std::shared_ptr<const ScanGrid> finish() const { return left_ == 0 ? grid_ : nullptr; }

 private:
  std::shared_ptr<ScanGrid> grid_;
  std::uint64_t left_;
};

std::shared_ptr<const ScanGrid> read_binary_grid(const InputFile& file, const PlyHeader& header, std::size_t element,
                                                 GridFiller filler) {
  const bool swapped = is_swapped(header.format);
  const PlyProperty& list = header.elements[element].properties.front();
  ByteCursor cursor(file, locate_element(file, header, element));
  for (std::uint64_t row = 0; row < header.elements[element].count; ++row) {
    const std::byte* bytes = cursor.take(static_cast<std::size_t>(byte_size(*list.list_count)));
    if (bytes == nullptr) return {};
    const auto entries = static_cast<long long>(load_scalar(*list.list_count, swapped, bytes));
    std::optional<long long> vertex;
    if (entries == 1) {
      bytes = cursor.take(static_cast<std::size_t>(byte_size(list.type)));
      if (bytes == nullptr) return {};
      vertex = static_cast<long long>(load_scalar(list.type, swapped, bytes));
    }
    if ((entries != 0 && entries != 1) || !filler.add(vertex)) return {};
  }
  return filler.finish();
}

std::shared_ptr<const ScanGrid> read_ascii_grid(const InputFile& file, const PlyHeader& header, std::size_t element,
                                                GridFiller filler) {
  LineReader lines(file, header.bytes, header.lines, header.line_end);
  std::string_view line;
  for (std::size_t e = 0; e < element; ++e) {
    if (header.elements[e].properties.empty()) continue;
    for (std::uint64_t row = 0; row < header.elements[e].count; ++row) {
      if (!lines.next(line)) return {};
    }
  }
  for (std::uint64_t row = 0; row < header.elements[element].count; ++row) {
    if (!lines.next(line)) return {};
    const char* const end = line.data() + line.size();
    double entries = -1;
    double vertex = 0;
    const char* p = std::find_if_not(line.data(), end, is_space);
    p = parse_number(p, end, entries);
    if (p == nullptr || (entries != 0 && entries != 1)) return {};
    if (entries == 1 && parse_number(std::find_if_not(p, end, is_space), end, vertex) == nullptr) return {};
    const bool whole = vertex >= 0 && vertex < 0x1p53;
    if (!whole || !filler.add(entries == 1 ? std::optional(static_cast<long long>(vertex)) : std::nullopt)) return {};
  }
  return filler.finish();
}

}  // namespace

PlyRows understand_vertices(const PlyHeader& header, const std::string& path, const std::string& name) {
  PlyRows rows;
  rows.element = vertex_element(header, name);
  const PlyElement& vertices = header.elements[rows.element];
  require_scalars(vertices, name);
  rows.info.path = path;
  rows.info.count = vertices.count;
  rows.info.crs = header.crs;
  rows.info.geographic = names_degrees(header.crs);
  for (const PlyProperty& property : vertices.properties) {
    rows.columns.push_back({property.name, property.type, rows.stride});
    rows.stride += static_cast<std::size_t>(byte_size(property.type));
  }
  use_usual_names(rows.columns);
  give_roles(rows.columns, rows.info, name, "property");
  // Stanford's range images are seen along z.
  const auto is_grid = [](const PlyElement& element) { return element.name == "range_grid"; };
  if (std::any_of(header.elements.begin(), header.elements.end(), is_grid))
    rows.info.scans = {{0, ScanPart::Scanner::direction, {0, 0, 1}}};
  return rows;
}

void report_short_file(const std::string& name, const std::string& element, std::uint64_t promised,
                       const std::string& held) {
  throw Error(ExitCode::unreadable,
              fmt::format("{}: the header promises {} rows of element {}, the file holds {}: it was cut short or the "
                          "header's count is wrong",
                          name, promised, quoted_word(element), held));
}

bool is_swapped(PlyFormat format) {
  return (format == PlyFormat::big_endian) != (std::endian::native == std::endian::big);
}

std::uint64_t locate_element(const InputFile& file, const PlyHeader& header, std::size_t wanted) {
  std::uint64_t offset = header.bytes;
  std::uint64_t found = offset;
  for (std::size_t i = 0; i < header.elements.size(); ++i) {
    const PlyElement& element = header.elements[i];
    if (i == wanted) found = offset;
    offset = element.has_list() ? end_of_lists(file, element, is_swapped(header.format), offset)
                                : end_of_fixed(file, element, offset);
  }
  require_end(file, offset);
  return found;
}

std::shared_ptr<const ScanGrid> read_range_grid(const InputFile& file, const PlyHeader& header) {
  const auto is_named = [](const char* name) { return [name](const PlyElement& e) { return e.name == name; }; };
  const auto grid = std::find_if(header.elements.begin(), header.elements.end(), is_named("range_grid"));
  const auto vertices = std::find_if(header.elements.begin(), header.elements.end(), is_named("vertex"));
  if (grid == header.elements.end() || vertices == header.elements.end() || grid->properties.size() != 1 ||
      !grid->properties.front().list_count || !is_integer_type(grid->properties.front().type))
    return {};
  std::string text(static_cast<std::size_t>(header.bytes), '\0');
  text.resize(file.read(0, text.data(), text.size()));
  const std::optional<std::uint64_t> length = number_after(text, "obj_info num_cols");
  if (!length || grid->count % *length != 0) return {};
  const auto element = static_cast<std::size_t>(grid - header.elements.begin());
  const GridFiller filler(*length, vertices->count);
  return header.format == PlyFormat::ascii ? read_ascii_grid(file, header, element, filler)
                                           : read_binary_grid(file, header, element, filler);
}

}  // namespace lamina
