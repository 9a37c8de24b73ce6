// Meshes to OBJ, OFF and binary STL. Ours, because OpenMesh's writers round positions to float and its OBJ writer
// refuses colours.
#pragma once
#include "base/result_file.h"
#include "lamina/mesh.h"

namespace lamina::meshes {

/// `v x y z [r g b]` with colours from 0 to 1, `vn`, faces `f v//vn`. Positions read back as the same bits.
void write_obj(const TriangleMesh& mesh, ResultFile& out);
/// [C][N]OFF with colours as r g b a bytes. Positions read back as the same bits.
void write_off(const TriangleMesh& mesh, ResultFile& out);
/// Positions as floats, facet normals computed; vertices and colours are not shared by this format.
void write_stl(const TriangleMesh& mesh, ResultFile& out);

}  // namespace lamina::meshes
