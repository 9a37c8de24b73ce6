// A part of a larger mesh simplified by itself, such that it still fits the others.
#pragma once
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina::simplify {

/// Vertices without triangles go; the others keep their order. Returns the new number of each, kNone of those that
/// went.
std::vector<std::uint32_t> drop_unused(TriangleMesh& mesh);

struct PartResult {
  double deviation = 0;  ///< largest root mean square distance of a new vertex from the planes it stands for
  std::vector<std::uint32_t> numbers;  ///< drop_unused()
};

/// Contracts edges (simplify_mesh()) until `triangles` are left, or no edge can go, or only a few can. Vertices whose
/// `locked` is not 0 keep place, normal, attributes and the edges between them, so that borders with other parts stay
/// as they are. The mesh need not be manifold: vertices of edges with more than two triangles, or with two that face
/// opposite sides, stay as well. The same for any number of threads. Throws Error(internal) when cancelled.
PartResult simplify_part(TriangleMesh& mesh, std::vector<std::uint8_t> locked, std::uint64_t triangles,
                         const RunContext& run);

}  // namespace lamina::simplify
