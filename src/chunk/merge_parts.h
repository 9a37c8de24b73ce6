// Parts in order, checked against each other.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "chunk/part_file.h"

namespace lamina {

/// Opens them all and puts them in order. Throws Error(unreadable) as merge_parts() does.
std::vector<PartReader> open_parts(const std::vector<std::string>& paths);

/// The records of a mesh file's faces: numbers counted from `first`, the mesh's number of the part's first vertex.
/// Throws Error(unreadable) where a number lies outside of the mesh's `vertices`.
void encode_shifted(std::span<const PartTriangle> triangles, std::uint64_t first, std::uint64_t vertices,
                    std::vector<std::byte>& out);

}  // namespace lamina
