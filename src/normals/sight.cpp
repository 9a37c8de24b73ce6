#include "normals/sight.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "meshes/vec3.h"
#include "normals/occupancy.h"

namespace lamina::normals {
namespace {

using meshes::dot;
using meshes::Vec3;

constexpr std::size_t kDirections = 98;  ///< over the whole sphere: a quarter of them to each side of a patch
constexpr double kCone = 0.5;            ///< least cosine to the normal of directions whose way counts
constexpr double kGlancing = 0.15;       ///< of those that may be open

/// To the places of a lattice around: about even over the sphere, and the same bits everywhere.
std::array<Vec3, kDirections> directions_all_around() {
  std::array<Vec3, kDirections> directions;
  std::size_t n = 0;
  for (int x = -2; x <= 2; ++x) {
    for (int y = -2; y <= 2; ++y) {
      for (int z = -2; z <= 2; ++z) {
        const bool odd = x % 2 != 0 || y % 2 != 0 || z % 2 != 0;  // else half as far lies the same, or nothing
        if (odd) directions[n++] = meshes::unit({double(x), double(y), double(z)});
      }
    }
  }
  return directions;
}

Sight look_from(const PatchNode& node, const Occupancy& around, const std::array<Vec3, kDirections>& directions) {
  Sight sight;
  const Vec3 outward{node.outward[0], node.outward[1], node.outward[2]};
  const double length = std::sqrt(dot(outward, outward));
  constexpr double kFlat = 0.5;  // of its area: crumpled patches have no sides
  if (!(length > kFlat * double{node.area})) return sight;
  const Vec3 at = around.place(node);
  for (const double side : {1.0, -1.0}) {
    Vec3 normal{};
    Vec3 from{};
    for (std::size_t a = 0; a < 3; ++a) {
      normal[a] = side * outward[a] / length;
      from[a] = at[a] + Occupancy::kClear * normal[a];
    }
    double open = 0;
    double looks = 0;
    double way = 0;
    double ways = 0;
    for (const Vec3& direction : directions) {
      const double cosine = dot(direction, normal);
      if (cosine < kGlancing) continue;
      const double free = std::min(1.0, around.way(from, direction) / around.diagonal());
      open += free < 1 ? 0 : 1;
      looks += 1;
      if (cosine < kCone) continue;
      way += free;
      ways += 1;
    }
    View& view = side > 0 ? sight.front : sight.back;
    view.open = static_cast<float>(open / looks);
    view.way = static_cast<float>(way / ways);
  }
  return sight;
}

}  // namespace

std::vector<Sight> look_around(const PatchGraph& graph, const Occupancy& around,
                               const std::vector<std::uint8_t>& wanted) {
  std::vector<Sight> sights(graph.nodes.size());
  if (around.empty()) return sights;
  const std::array<Vec3, kDirections> directions = directions_all_around();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(1, graph.nodes.size(), 64), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      if (wanted[i] != 0) sights[i] = look_from(graph.nodes[i], around, directions);
    }
  });
  return sights;
}

}  // namespace lamina::normals
