// The edges of a triangle mesh with the triangle sides that run along each.
#pragma once
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "lamina/mesh.h"

namespace lamina::measure {

/// Vertex numbers, ascending.
using Edge = std::array<std::uint32_t, 2>;

/// True when the triangle names a vertex twice.
inline bool repeats_index(const std::array<std::uint32_t, 3>& t) {
  return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

/// Side k of triangle t, from its corner k to corner (k + 1) % 3.
struct Side {
  std::uint32_t high = 0;    ///< the edge's higher vertex
  std::uint32_t corner = 0;  ///< 3 t + k
  [[nodiscard]] std::uint32_t next_corner() const { return corner % 3 == 2 ? corner - 2 : corner + 1; }
};

/// Sides grouped by edge: by lower vertex through a counting sort, then by the higher. Triangles that repeat an index
/// have none. Wants fewer than 2^32 / 3 triangles.
class EdgeTable {
 public:
  explicit EdgeTable(const TriangleMesh& mesh) : start_(mesh.positions.size() + 2) {
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

  /// Calls visit(std::span<const Side>) once per edge; sides of an edge stand in the order of their triangles.
  template <class Visit>
  void for_each_edge(Visit&& visit) const {
    for (std::size_t v = 0; v + 1 < start_.size(); ++v)
      for (std::size_t i = start_[v]; i < start_[v + 1];) {
        std::size_t j = i + 1;
        while (j < start_[v + 1] && sides_[j].high == sides_[i].high) ++j;
        visit(std::span<const Side>(sides_.data() + i, j - i));
        i = j;
      }
  }

 private:
  std::vector<std::uint32_t> start_;  ///< first side of each lower vertex
  std::vector<Side> sides_;
};

/// The edges of only one triangle, in ascending order.
inline std::vector<Edge> boundary_edges(const TriangleMesh& mesh) {
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
