#include "points/ply_range_grid.h"

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>

#include "points/byte_cursor.h"
#include "points/line_reader.h"
#include "points/number.h"
#include "points/ply_columns.h"
#include "points/ply_walk.h"

namespace lamina {
namespace {

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
class Filler {
 public:
  Filler(std::uint64_t length, std::uint64_t vertices) : grid_(std::make_shared<ScanGrid>(length)), left_(vertices) {}
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

std::shared_ptr<const ScanGrid> read_binary(const InputFile& file, const PlyHeader& header, std::size_t element,
                                            Filler filler) {
  const bool swapped = is_swapped(header.format);
  const PlyProperty& list = header.elements[element].properties.front();
  ByteCursor cursor(file, locate_element(file, header, element));
  for (std::uint64_t row = 0; row < header.elements[element].count; ++row) {
    const std::byte* bytes = cursor.take(static_cast<std::size_t>(byte_size(*list.list_count)));
    if (bytes == nullptr) return {};
    const long long entries = read_integer(*list.list_count, swapped, bytes);
    std::optional<long long> vertex;
    if (entries == 1) {
      bytes = cursor.take(static_cast<std::size_t>(byte_size(list.type)));
      if (bytes == nullptr) return {};
      vertex = read_integer(list.type, swapped, bytes);
    }
    if ((entries != 0 && entries != 1) || !filler.add(vertex)) return {};
  }
  return filler.finish();
}

std::shared_ptr<const ScanGrid> read_ascii(const InputFile& file, const PlyHeader& header, std::size_t element,
                                           Filler filler) {
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

std::shared_ptr<const ScanGrid> read_range_grid(const InputFile& file, const PlyHeader& header) {
  const auto is_named = [](const char* name) { return [name](const PlyElement& e) { return e.name == name; }; };
  const auto grid = std::find_if(header.elements.begin(), header.elements.end(), is_named("range_grid"));
  const auto vertices = std::find_if(header.elements.begin(), header.elements.end(), is_named("vertex"));
  if (grid == header.elements.end() || vertices == header.elements.end() || grid->properties.size() != 1 ||
      !grid->properties.front().list_count || grid->properties.front().type == ScalarType::float32 ||
      grid->properties.front().type == ScalarType::float64)
    return {};
  std::string text(static_cast<std::size_t>(header.bytes), '\0');
  text.resize(file.read(0, text.data(), text.size()));
  const std::optional<std::uint64_t> length = number_after(text, "obj_info num_cols");
  if (!length || grid->count % *length != 0) return {};
  const auto element = static_cast<std::size_t>(grid - header.elements.begin());
  const Filler filler(*length, vertices->count);
  return header.format == PlyFormat::ascii ? read_ascii(file, header, element, filler)
                                           : read_binary(file, header, element, filler);
}

}  // namespace lamina
