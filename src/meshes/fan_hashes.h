// Which vertices of a streamed mesh lie on its boundary: around one inside, every neighbour comes next in one triangle
// and before in another; at the ends of an open fan it does not.
#pragma once
#include <cstdint>
#include <vector>

#include "base/hashing.h"
#include "meshes/mesh_slab.h"

namespace lamina {

/// What vertices sum up over their triangles: 0 inside, on the boundary a number that tells the ends of the fan.
using FanHashes = std::vector<std::uint64_t>;

/// Of a fan with these ends.
constexpr std::uint64_t fan_hash(std::uint64_t next, std::uint64_t before) {
  return scrambled(next) - scrambled(before);
}

/// Adds the triangles of a slab to the sums of its vertices, `first` and on, and to those of the slab below.
inline void add_fans(const MeshSlab& slab, std::uint32_t first, FanHashes& here, FanHashes& below) {
  const std::uint32_t first_below = first - static_cast<std::uint32_t>(below.size());
  for (const auto& t : slab.triangles) {
    const std::uint64_t a = scrambled(t[0]), b = scrambled(t[1]), c = scrambled(t[2]);
    const auto add = [&](std::uint32_t v, std::uint64_t hash) {
      (v < first ? below[v - first_below] : here[v - first]) += hash;
    };
    add(t[0], b - c);
    add(t[1], c - a);
    add(t[2], a - b);
  }
}

}  // namespace lamina
