#include "measure/edge_table.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace lamina::measure {

EdgeTable::EdgeTable(const TriangleMesh& mesh) : start_(mesh.positions.size() + 2) {
  // Counts go two places up, so that filling the table leaves start_ as the first side of each vertex.
  for (const auto& t : mesh.triangles)
    if (!repeats_index(t))
      for (std::size_t k = 0; k < 3; ++k) ++start_[std::min(t[k], t[(k + 1) % 3]) + std::size_t{2}];
  for (std::size_t v = 1; v < start_.size(); ++v) start_[v] += start_[v - 1];
  sides_.resize(start_.back());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& t = mesh.triangles[i];
    if (repeats_index(t)) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(t[k], t[(k + 1) % 3]);
      sides_[start_[low + std::size_t{1}]++] = {high, static_cast<std::uint32_t>(3 * i + k)};
    }
  }
  start_.pop_back();
  tbb::parallel_for(std::size_t{0}, start_.size() - 1, [&](std::size_t v) {
    std::sort(sides_.begin() + start_[v], sides_.begin() + start_[v + 1],
              [](const Side& a, const Side& b) { return a.high != b.high ? a.high < b.high : a.corner < b.corner; });
  });
}

std::vector<Edge> boundary_edges(const TriangleMesh& mesh) {
  std::vector<Edge> edges;
  EdgeTable(mesh).for_each_edge([&](std::span<const Side> sides) {
    if (sides.size() != 1) return;
    const auto& t = mesh.triangles[sides[0].corner / 3];
    const auto [low, high] = std::minmax(t[sides[0].corner % 3], t[sides[0].next_corner() % 3]);
    edges.push_back({low, high});
  });
  return edges;
}

}  // namespace lamina::measure
