// Meshes to binary little-endian PLY.
#pragma once
#include "base/result_file.h"
#include "lamina/mesh.h"

namespace lamina::meshes {

/// True when every position survives a round trip through float.
bool fits_float(const TriangleMesh& mesh);

/// Positions as float where that loses nothing, else double; normals; attributes in their own types (rounded and
/// clamped to them); faces as `list uchar int vertex_indices` (uint beyond 2^31 - 1 vertices).
void write_ply(const TriangleMesh& mesh, ResultFile& out);

}  // namespace lamina::meshes
