#include "meshes/mesh_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <limits>
#include <set>

#include "base/ply_type.h"
#include "lamina/error.h"

namespace lamina {
namespace {

constexpr std::string_view kPaddingStart = "comment ";

std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
  return text;
}

/// The header with `padding` characters of a last comment; that line is there even when they are none.
std::string header_text(const MeshSinkSettings& settings, std::uint64_t vertices, std::uint64_t triangles,
                        std::string_view index_type, std::size_t padding) {
  std::string text = fmt::format("ply\nformat binary_little_endian 1.0\ncomment {}\n", sink_signature());
  for (const std::string& comment : settings.comments) text += fmt::format("comment {}\n", one_line(comment));
  text += fmt::format("element vertex {}\n", vertices);
  const std::string_view position = settings.double_positions ? "double" : "float";
  for (const char* axis : {"x", "y", "z"}) text += fmt::format("property {} {}\n", position, axis);
  for (const char* axis : {"nx", "ny", "nz"}) text += fmt::format("property float {}\n", axis);
  for (const AttributeSpec& attribute : settings.attributes) {
    text += fmt::format("property {} {}\n", ply_name(attribute.type), attribute.name);
  }
  text += fmt::format("element face {}\nproperty list uchar {} vertex_indices\n", triangles, index_type);
  return text + std::string(kPaddingStart) + std::string(padding, '-') + "\nend_header\n";
}

}  // namespace

void require_ply_names(const AttributeLayout& attributes) {
  std::set<std::string_view> taken{"x", "y", "z", "nx", "ny", "nz"};
  for (const AttributeSpec& attribute : attributes) {
    const bool plain =
        !attribute.name.empty() && std::all_of(attribute.name.begin(), attribute.name.end(),
                                               [](unsigned char c) { return std::iscntrl(c) == 0 && c != ' '; });
    if (!plain || !taken.insert(attribute.name).second) {
      throw Error(ExitCode::internal,
                  fmt::format("attribute '{}' cannot be written to a PLY: its name is empty, has blanks, "
                              "or is there twice",
                              one_line(attribute.name)));
    }
  }
}

std::size_t mesh_header_bytes(const MeshSinkSettings& settings) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  return header_text(settings, kMost, kMost, "uint", 0).size();
}

std::string mesh_header(const MeshSinkSettings& settings, std::uint64_t vertices, std::uint64_t triangles) {
  constexpr std::uint64_t kMostSigned = std::numeric_limits<std::int32_t>::max();
  const std::string_view index_type = vertices > kMostSigned ? "uint" : "int";
  const std::size_t bare = header_text(settings, vertices, triangles, index_type, 0).size();
  return header_text(settings, vertices, triangles, index_type, mesh_header_bytes(settings) - bare);
}

}  // namespace lamina
