// The formats' readers behind read_mesh().
#pragma once
#include <istream>
#include <string>

#include "lamina/mesh.h"
#include "meshes/file_stream.h"

namespace lamina::meshes {

/// PLY in all three encodings, double positions and any scalar attributes kept. Ours, because OpenMesh's reader rounds
/// positions to float and forgets attributes it does not know. Throws Error(unreadable).
TriangleMesh read_ply(FileBuffer& file, const std::string& path);

/// Ours as well: OpenMesh's reader takes a stream's colours and normals only when it has opened the same file by name
/// before.
TriangleMesh read_off(FileBuffer& file, const std::string& path);

enum class TextFormat { obj, stl };

/// Through OpenMesh's reader of the format, every face kept. Throws Error(unreadable).
TriangleMesh read_with_openmesh(FileBuffer& file, const std::string& path, TextFormat format);

}  // namespace lamina::meshes
