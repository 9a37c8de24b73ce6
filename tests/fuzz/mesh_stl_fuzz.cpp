#include "mesh_harness.h"

FUZZED(mesh_stl) {
  using namespace lamina::meshes;
  return lamina::fuzz::run_mesh(data, size, [](FileBuffer& file, const std::string& path) {
    return read_with_openmesh(file, path, TextFormat::stl);
  });
}
