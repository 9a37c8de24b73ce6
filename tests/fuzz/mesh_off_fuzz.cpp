#include "mesh_harness.h"

FUZZED(mesh_off) {
  return lamina::fuzz::run_mesh(data, size, lamina::meshes::read_off);
}
