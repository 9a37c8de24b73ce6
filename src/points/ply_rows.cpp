#include "points/ply_rows.h"

#include <fmt/format.h>

#include <algorithm>

#include "lamina/error.h"

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

}  // namespace

PlyRows understand_vertices(const PlyHeader& header, const std::string& path, const std::string& name) {
  PlyRows rows;
  rows.element = vertex_element(header, name);
  const PlyElement& vertices = header.elements[rows.element];
  require_scalars(vertices, name);
  rows.info.path = path;
  rows.info.count = vertices.count;
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

}  // namespace lamina
