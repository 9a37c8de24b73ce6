#include "mesh_harness.h"

FUZZED(mesh_ply) {
  return lamina::fuzz::run_mesh(data, size, lamina::meshes::read_ply);
}
