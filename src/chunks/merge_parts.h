// Parts in order, checked against each other.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "chunks/part_file.h"

namespace lamina {

/// Opens them all and puts them in order. Throws Error(unreadable) as merge_parts() does.
std::vector<PartReader> open_parts(const std::vector<std::string>& paths);

/// The records of a mesh file's faces: numbers counted from `first`, the mesh's number of the part's first vertex.
/// Throws Error(unreadable) naming the part where a number lies outside of the mesh's `vertices`.
void encode_shifted(std::span<const PartTriangle> triangles, std::uint64_t first, std::uint64_t vertices,
                    const std::string& part, std::vector<std::byte>& out);

/// The records of what closes a mesh's holes: vertices, the first of number `first`, and faces of a mesh of `vertices`.
std::vector<std::byte> encode_addition(const VertexBatch& vertices, const MeshSinkSettings& layout,
                                       std::uint64_t first);
std::vector<std::byte> encode_addition(const std::vector<std::array<std::uint32_t, 3>>& triangles,
                                       std::uint64_t vertices);

}  // namespace lamina
