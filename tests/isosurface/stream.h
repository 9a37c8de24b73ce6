// Extraction of a filled window slab by slab, the way the job does it, and the whole mesh that comes of it.
#pragma once
#include <algorithm>
#include <array>
#include <functional>
#include <tuple>
#include <vector>

#include "isosurface/extract.h"
#include "support/mesh_check.h"
#include "support/octree_window.h"

namespace lamina::test {

struct WholeMesh {
  Triangles triangles;
  std::vector<IsoVertex> vertices;
  std::vector<std::array<float, 3>> positions;
  std::vector<std::array<std::int32_t, 3>> low, high;  ///< positions of the vertices' corners
  ExtractCounts counts;
  std::vector<IsoSlab> slabs;

  /// Triangles named by the places of their vertices, in an order of their own: for comparing meshes numbered
  /// differently.
  [[nodiscard]] auto named() const {
    using Name = std::tuple<std::array<std::int32_t, 3>, std::array<std::int32_t, 3>, float, int>;
    std::vector<std::array<Name, 3>> out;
    for (const auto& t : triangles) {
      std::array<Name, 3> names;
      for (int i = 0; i < 3; ++i) names[i] = {low[t[i]], high[t[i]], vertices[t[i]].t, vertices[t[i]].open};
      std::rotate(names.begin(), std::min_element(names.begin(), names.end()), names.end());
      out.push_back(names);
    }
    std::sort(out.begin(), out.end());
    return out;
  }
};

/// `prepare` sees every slab's storage before it is filled.
inline WholeMesh extract_all(Window& window, std::int32_t first, std::int32_t end,
                             const std::function<void(IsoSlab&)>& prepare = {}) {
  WholeMesh mesh;
  mesh.slabs.resize(static_cast<std::size_t>(end - first) + 1);
  if (prepare) std::for_each(mesh.slabs.begin(), mesh.slabs.end(), prepare);
  for (std::int32_t s = first; s <= end; ++s) {
    const std::size_t i = static_cast<std::size_t>(s - first);
    number_edges(window, s, {}, i > 0 ? &mesh.slabs[i - 1] : nullptr, mesh.slabs[i]);
    if (i == 0) continue;
    triangulate(window, s - 1, mesh.slabs[i - 1], mesh.slabs[i], mesh.counts);
    separate_fans(i > 1 ? &mesh.slabs[i - 2] : nullptr, mesh.slabs[i - 1], &mesh.slabs[i], mesh.counts);
    window.retire_below(s - 1);
  }
  separate_fans(&mesh.slabs[mesh.slabs.size() - 2], mesh.slabs.back(), nullptr, mesh.counts);

  std::vector<std::uint32_t> base;
  for (const IsoSlab& slab : mesh.slabs) {
    base.push_back(static_cast<std::uint32_t>(mesh.vertices.size()));
    const std::size_t i = base.size() - 1;
    const auto corner = [&](SlabIndex c) -> const SurfaceCorner& {
      return c.next() ? mesh.slabs[i + 1].corners.at(c.index()) : slab.corners.at(c.index());
    };
    for (const IsoVertex& v : slab.vertices) {
      mesh.vertices.push_back(v);
      const auto& low = mesh.low.emplace_back(corner(v.low).position);
      const auto& high = mesh.high.emplace_back(corner(v.high).position);
      std::array<float, 3> p{};
      for (int k = 0; k < 3; ++k) p[k] = static_cast<float>(low[k]) + v.t * static_cast<float>(high[k] - low[k]);
      mesh.positions.push_back(p);
    }
  }
  for (std::size_t i = 0; i < mesh.slabs.size(); ++i) {
    for (const IsoTriangle& t : mesh.slabs[i].triangles) {
      auto& out = mesh.triangles.emplace_back();
      for (int k = 0; k < 3; ++k) out[k] = base[i + (t[k].next() ? 1 : 0)] + t[k].index();
    }
  }
  return mesh;
}

}  // namespace lamina::test
