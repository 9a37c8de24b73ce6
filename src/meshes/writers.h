// The formats' writers behind write_mesh(). Ours, because OpenMesh's writers round positions to float and its OBJ
// writer refuses colours.
#pragma once
#include "base/output_file.h"
#include "lamina/mesh.h"

namespace lamina::meshes {

/// True when every position survives a round trip through float.
bool fits_float(const TriangleMesh& mesh);

/// Positions as float where that loses nothing, else double; normals; attributes in their own types (rounded and
/// clamped to them); faces as `list uchar int vertex_indices` (uint beyond 2^31 - 1 vertices).
void write_ply(const TriangleMesh& mesh, ResultFile& out);

/// `v x y z [r g b]` with colours from 0 to 1, `vn`, faces `f v//vn`. Positions read back as the same bits.
void write_obj(const TriangleMesh& mesh, ResultFile& out);
/// [C][N]OFF with colours as r g b a bytes. Positions read back as the same bits.
void write_off(const TriangleMesh& mesh, ResultFile& out);
/// Positions as floats, facet normals computed; vertices and colours are not shared by this format.
void write_stl(const TriangleMesh& mesh, ResultFile& out);

}  // namespace lamina::meshes
