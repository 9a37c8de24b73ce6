#include <fmt/format.h>

#include <array>
#include <utility>

#include "lamina/file_ending.h"
#include "base/result_file.h"
#include "lamina/error.h"
#include "lamina/mesh.h"
#include "meshes/ply_writer.h"
#include "meshes/text_writers.h"

namespace lamina {

void write_mesh(const TriangleMesh& mesh, const std::string& path) {
  using Writer = void (*)(const TriangleMesh&, ResultFile&);
  static constexpr std::array<std::pair<const char*, Writer>, 4> kWriters{{{".ply", meshes::write_ply},
                                                                           {".obj", meshes::write_obj},
                                                                           {".off", meshes::write_off},
                                                                           {".stl", meshes::write_stl}}};
  for (const auto& [format, write] : kWriters) {
    const bool standard = path == "-" && format == kWriters.front().first;
    if (path.ends_with(".gz") || (packed_ending(path) != format && !standard)) continue;
    ResultFile out(path);
    write(mesh, out);
    out.commit();
    return;
  }
  throw Error(ExitCode::usage, fmt::format("{}: unknown mesh format to write; known are .ply, .obj, .off, .stl", path));
}

}  // namespace lamina
