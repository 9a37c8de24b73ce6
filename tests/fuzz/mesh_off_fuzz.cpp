#include "mesh_harness.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return lamina::fuzz::run_mesh(data, size, lamina::meshes::read_off);
}
