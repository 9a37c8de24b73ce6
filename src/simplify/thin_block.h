// A stretch of a mesh's triangles, to be thinned out by itself.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "meshes/mesh_blocks.h"
#include "simplify/matching.h"

namespace lamina::simplify {

/// Triangles that follow each other, with their vertices. Where these do not close around a vertex it is *open*, and
/// locked: there may be others.
struct ThinBlock {
  ThinPart part;
  std::vector<std::uint32_t> ids;  ///< of the vertices in the mesh, ascending
  /// Of each vertex: over triangles the sum of a hash of the vertex that follows less one of that before. 0: closed.
  std::vector<std::uint64_t> turns;

  /// In the memory that is there. Throws Error(unreadable) for triangles that name vertices that are not there or
  /// repeat one, and for vertices that are nowhere.
  void read(meshes::MeshBlocks& mesh, std::uint64_t first, std::size_t count);
  /// What its vertices stand for, what contracting them may cost, and which are open. `deviation`: of thin_blocks().
  void survey(double deviation);
};

[[noreturn]] void refuse_to_thin(const char* what);

}  // namespace lamina::simplify
