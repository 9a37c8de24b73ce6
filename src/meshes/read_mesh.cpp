#include <fmt/format.h>

#include <cctype>
#include <cmath>
#include <filesystem>

#include "lamina/error.h"
#include "lamina/mesh.h"
#include "meshes/readers.h"

namespace lamina {
namespace {

/// Extension in lower case, the one before .gz where there is one.
std::string format_of(const std::string& path) {
  std::filesystem::path p(path);
  if (p.extension() == ".gz") p = p.stem();
  std::string e = p.extension().string();
  for (char& c : e) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return e;
}

TriangleMesh read_by_format(meshes::FileBuffer& file, const std::string& path) {
  std::istream in(&file);
  std::string magic(4, '\0');
  in.read(magic.data(), 4);
  magic.resize(static_cast<std::size_t>(in.gcount()));
  file.require_sound();
  if (magic.empty()) throw Error(ExitCode::unreadable, fmt::format("{}: is empty", path));
  in.clear();
  in.seekg(0);
  const std::string format = format_of(path);
  if (magic == "ply\n" || magic == "ply\r" || format == ".ply") return meshes::read_ply(file, path);
  if (format == ".obj") return meshes::read_with_openmesh(file, path, meshes::TextFormat::obj);
  if (format == ".off") return meshes::read_with_openmesh(file, path, meshes::TextFormat::off);
  if (format == ".stl") return meshes::read_with_openmesh(file, path, meshes::TextFormat::stl);
  throw Error(
      ExitCode::unreadable,
      fmt::format("{}: unknown mesh format \"{}\"; known are .ply, .obj, .off, .stl, each also as .gz", path, format));
}

}  // namespace

TriangleMesh read_mesh(const std::string& path, NonFinite non_finite) {
  meshes::FileBuffer file(path);
  TriangleMesh mesh = read_by_format(file, path);
  if (mesh.positions.empty()) throw Error(ExitCode::unreadable, fmt::format("{}: has no vertices", path));
  if (non_finite == NonFinite::keep) return mesh;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    for (const double c : mesh.positions[i])
      if (!std::isfinite(c))
        throw Error(ExitCode::unreadable,
                    fmt::format("{}: vertex {} has a coordinate that is not finite; clean the mesh first", path, i));
  return mesh;
}

}  // namespace lamina
