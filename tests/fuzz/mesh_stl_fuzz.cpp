#include "mesh_harness.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace lamina::meshes;
  return lamina::fuzz::run_mesh(data, size, [](FileBuffer& file, const std::string& path) {
    return read_with_openmesh(file, path, TextFormat::stl);
  });
}
