// The header of a streamed mesh: its length is known before its counts.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>

#include "meshes/mesh_sink.h"

namespace lamina {

/// Throws Error(internal) when a name is empty, has blanks, or is there twice (x y z nx ny nz are taken).
void require_ply_names(const AttributeLayout& attributes);

/// Bytes to keep free for mesh_header() whatever the counts.
std::size_t mesh_header_bytes(const MeshSinkSettings& settings);

/// The header, padded by a comment to mesh_header_bytes(). Line breaks in comments become blanks.
std::string mesh_header(const MeshSinkSettings& settings, std::uint64_t vertices, std::uint64_t triangles);

}  // namespace lamina
