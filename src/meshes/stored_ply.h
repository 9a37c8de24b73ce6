// PLY files that are the records of a streamed mesh, to be read where they lie.
#pragma once
#include <optional>
#include <string>

#include "base/descriptor.h"
#include "meshes/mesh_sink.h"
#include "meshes/stored_mesh.h"

namespace lamina::meshes {

struct StoredPly {
  Descriptor file;
  MeshSinkSettings layout;  ///< its name, attributes and kind of positions
  StoredMesh mesh;
};

/// A file as MeshSink writes them: binary, little-endian, x y z nx ny nz and further numbers, triangles, and as long as
/// its header says. Nothing for any other file. Throws Error(unreadable) where it cannot be read or its header is
/// damaged.
std::optional<StoredPly> open_stored_ply(const std::string& path);

/// Of a comment `crs ...`; empty where there is none, and for what is no PLY. Throws as above.
std::string crs_of_ply(const std::string& path);

}  // namespace lamina::meshes
