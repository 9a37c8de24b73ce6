// A part of a larger mesh simplified by itself, such that it still fits the others.
#pragma once
#include <tbb/enumerable_thread_specific.h>

#include <cstdint>
#include <span>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "simplify/matching.h"

namespace lamina::simplify {

/// Vertices whose `stays` is 0 leave the arrays; triangles are not looked at.
void keep_vertices(TriangleMesh& mesh, std::span<const std::uint8_t> stays);

/// Vertices without triangles go; the others keep their order. Returns the new number of each, kNone of those that
/// went.
std::vector<std::uint32_t> drop_unused(TriangleMesh& mesh);

struct PartResult {
  double deviation = 0;  ///< largest root mean square distance of a new vertex from the planes it stands for
  std::vector<std::uint32_t> numbers;  ///< drop_unused()
};

/// Simplifies one part after the other, side by side in several threads, each of which keeps its memory.
class PartSimplifier {
 public:
  /// Contracts edges until `triangles` are left, or only a few can go (Matching). Vertices whose `locked` is not 0 keep
  /// place, normal, attributes and the edges between them, so that borders with other parts stay as they are. The mesh
  /// need not be manifold. Depends on the mesh alone. Throws Error(internal) when cancelled.
  PartResult simplify(TriangleMesh& mesh, std::span<const std::uint8_t> locked, std::uint64_t triangles,
                      const RunContext& run);

 private:
  tbb::enumerable_thread_specific<Matching> matchings_;
};

}  // namespace lamina::simplify
