#include "render/boundary.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cstddef>

namespace lamina::render_detail {

std::vector<Edge> boundary_edges(const TriangleMesh& mesh) {
  std::vector<std::uint64_t> keys;
  keys.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(t[i], t[(i + 1) % 3]);
      keys.push_back(std::uint64_t{low} << 32 | high);
    }
  }
  tbb::parallel_sort(keys.begin(), keys.end());
  std::vector<Edge> edges;
  for (std::size_t i = 0; i < keys.size();) {
    std::size_t end = i + 1;
    while (end < keys.size() && keys[end] == keys[i]) ++end;
    if (end == i + 1) edges.push_back({static_cast<std::uint32_t>(keys[i] >> 32), static_cast<std::uint32_t>(keys[i])});
    i = end;
  }
  return edges;
}

}  // namespace lamina::render_detail
