// A streamed mesh thinned out where it is flat, in one pass from its first triangle to its last.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "lamina/simplify.h"
#include "meshes/formats.h"

namespace lamina::simplify {

/// Triangles that are read at once: no more of any mesh.
constexpr std::size_t kThinBlock = 1U << 18;
/// Of a mesh of so many. Part of what the result is.
std::size_t thin_block_of(std::uint64_t triangles);

/// Contracts edges while the root mean square distance of the new vertex from the planes it stands for is at most
/// `deviation` (> 0) times the length of an edge there. Vertices on boundaries stay where they are. Triangles had
/// better name vertices near those of the triangle before, as in streamed meshes. Gives the result to `take` piece by
/// piece: its triangles name vertices counted over all pieces. `block`: of thin_block_of(), where it is 0. Throws
/// Error(unreadable) for triangles that name vertices that are not there or repeat one, and for meshes found not to be
/// manifold, Error(internal) when cancelled.
SimplifyStats thin_blocks(meshes::MeshBlocks& mesh, double deviation, const std::function<void(TriangleMesh)>& take,
                          const RunContext& run, std::size_t block = 0);

}  // namespace lamina::simplify
