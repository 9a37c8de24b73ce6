#include "mesh_harness.h"

FUZZED(mesh_glb) {
  return lamina::fuzz::run_mesh(data, size, lamina::meshes::read_glb);
}
