// The bytes of a streamed mesh, a binary little-endian PLY: a header whose length is known before its counts, vertices
// and faces.
#pragma once
#include <array>
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

/// Bytes of a vertex: positions (float or double), normal, attributes in their own types.
std::size_t vertex_record_bytes(const AttributeLayout& attributes, bool double_positions);

/// Bytes of a triangle: the list's length and three indices.
constexpr std::size_t kFaceRecordBytes = 1 + 3 * sizeof(std::uint32_t);

/// Throws Error(internal) when an array is not as long as the batch, or a number is not finite in the type it is
/// written as; `first` is the number of the batch's first vertex, for the message.
void require_writable(const VertexBatch& batch, const AttributeLayout& attributes, bool double_positions,
                      std::uint64_t first);

/// Writes vertices [first, first + count) of a batch that is writable.
void encode_vertices(const VertexBatch& batch, const AttributeLayout& attributes, bool double_positions,
                     std::size_t first, std::size_t count, std::byte* out);

/// Writes `count` faces; returns their largest vertex index (0 for none).
std::uint32_t encode_faces(const std::array<std::uint32_t, 3>* triangles, std::size_t count, std::byte* out);

}  // namespace lamina
