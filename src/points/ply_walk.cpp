#include "points/ply_walk.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "lamina/error.h"
#include "points/byte_cursor.h"
#include "points/ply_columns.h"
#include "points/ply_rows.h"

namespace lamina {
namespace {

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
        entries = read_integer(*property.list_count, swapped, length);
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

}  // namespace

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

}  // namespace lamina
