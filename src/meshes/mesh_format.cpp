#include "meshes/mesh_format.h"

#include <fmt/format.h>

#include <array>
#include <string>
#include <utility>

#include "lamina/file_ending.h"
#include "meshes/colours.h"
#include "meshes/mesh_sink.h"

namespace lamina::meshes {
namespace {

/// One line about what the format of a name cannot hold; empty where nothing is lost.
std::string describe_losses(const MeshSinkSettings& mesh, const std::string& path) {
  const MeshFormat format = mesh_format(path);
  if (format == MeshFormat::ply || format == MeshFormat::glb) return {};
  const bool bare = format == MeshFormat::stl;
  const bool coloured = !bare && find_colours(mesh.attributes);
  std::string names;
  for (const AttributeSpec& attribute : mesh.attributes) {
    const bool colour = attribute.name == "red" || attribute.name == "green" || attribute.name == "blue";
    if (!(coloured && colour)) names += (names.empty() ? "" : ", ") + attribute.name;
  }
  const std::string ending = file_ending(path);
  std::string text;
  if (!names.empty()) {
    text = fmt::format("an {} file has no place for the properties {}; a .ply keeps them", ending, names);
    if (bare)
      text = fmt::format("an {} file holds triangles alone, not the properties {}; a .ply keeps them", ending, names);
  }
  if (bare && mesh.double_positions) {
    text += fmt::format("{}its coordinates are floats, too coarse for these: --local subtracts a round shift",
                        text.empty() ? "" : "; ");
  }
  return text.empty() ? text : fmt::format("{}: {}", path, text);
}

}  // namespace

std::optional<MeshFormat> known_mesh_format(std::string_view path) {
  static constexpr std::array<std::pair<std::string_view, MeshFormat>, 5> kEndings{{{".ply", MeshFormat::ply},
                                                                                    {".obj", MeshFormat::obj},
                                                                                    {".off", MeshFormat::off},
                                                                                    {".stl", MeshFormat::stl},
                                                                                    {".glb", MeshFormat::glb}}};
  const std::string ending = file_ending(path);
  for (const auto& [name, format] : kEndings) {
    if (ending == name) return format;
  }
  return std::nullopt;
}

MeshFormat mesh_format(std::string_view path) {
  return known_mesh_format(path).value_or(MeshFormat::ply);
}

void warn_of_losses(const MeshSinkSettings& mesh, const RunContext& run) {
  for (const std::string& path : mesh.paths()) {
    if (const std::string losses = describe_losses(mesh, path); !losses.empty()) run.warn(losses);
  }
}

}  // namespace lamina::meshes
