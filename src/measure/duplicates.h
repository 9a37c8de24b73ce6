// Repeated vertices and triangles.
#pragma once
#include <cstdint>

#include "lamina/mesh.h"

namespace lamina::measure {

/// Vertices at the exact position of an earlier one (0 and -0 are the same; a NaN equals nothing).
std::uint64_t count_duplicate_vertices(const TriangleMesh& mesh);
/// Triangles naming the same three vertices as an earlier one, in any order; those that repeat an index do not count.
std::uint64_t count_duplicate_triangles(const TriangleMesh& mesh);

}  // namespace lamina::measure
