// A slab of a streamed mesh, as the stages behind the window hand it on.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "meshes/mesh_sink.h"

namespace lamina {

/// Triangles name vertices of this slab and of the one before, counted over all slabs.
struct MeshSlab {
  std::int64_t slab = 0;
  VertexBatch vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Calls use(vertex, next, before) for the corners in triangles of a slab's vertices [first, end); `vertex` counts from
/// the first.
template <typename Use>
void for_corners(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::uint32_t first, std::uint32_t end,
                 const Use& use) {
  for (const auto& t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[k] >= first && t[k] < end) use(t[k] - first, t[(k + 1) % 3], t[(k + 2) % 3]);
    }
  }
}

}  // namespace lamina
