// Passes over a mesh that is written block by block.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/writers.h"

namespace lamina::meshes {

inline constexpr std::size_t kBlockRows = 4096;  ///< vertices or triangles read at once

/// Calls use(block, index in it) for every vertex.
template <class Use>
void for_vertices(MeshBlocks& mesh, const Use& use) {
  TriangleMesh block;
  for (std::uint64_t first = 0; first < mesh.vertices(); first += kBlockRows) {
    const std::size_t n = std::min<std::uint64_t>(kBlockRows, mesh.vertices() - first);
    mesh.read_vertices(first, n, block);
    for (std::size_t v = 0; v < n; ++v) use(block, v);
  }
}

template <class Use>
void for_triangles(MeshBlocks& mesh, const Use& use) {
  std::vector<std::array<std::uint32_t, 3>> block;
  for (std::uint64_t first = 0; first < mesh.triangles(); first += kBlockRows) {
    const std::size_t n = std::min<std::uint64_t>(kBlockRows, mesh.triangles() - first);
    mesh.read_triangles(first, n, block);
    for (const auto& t : block) use(t);
  }
}

}  // namespace lamina::meshes
