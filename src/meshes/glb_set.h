// A mesh that is too large for one GLB: its first piece in the GLB, the others in files beside it.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "base/output_file.h"
#include "meshes/mesh_format.h"
#include "meshes/writers.h"

namespace lamina::meshes {

/// The triangles in their order, a primitive for each buffer with vertices of its own, some of which others have as
/// well: which of the mesh's they are is noted, so that reading makes it one again. Files are named NAME.1.SUM.bin by
/// what is in them, so that those of an older mesh stay until the new GLB has replaced the one that names them. Keeps
/// two bits for each vertex of the mesh, and blocks. Throws Error(budget) where `out` is a pipe or device; else as
/// write_glb() does.
void write_glb_set(MeshBlocks& mesh, ResultFile& out, const GlbLimits& limits);

/// The files with such names that the GLB at `path` says its data lie in; none where it is no GLB of that kind.
std::vector<std::string> companions_of_glb(const std::string& path);

/// A file's name as a relative URI, and back; nothing where it would lead out of the folder or to another place.
std::string uri_of_file(const std::string& name);
std::optional<std::string> file_of_uri(const std::string& uri);

}  // namespace lamina::meshes
