#include "tiles/tile_mesh.h"

#include <algorithm>
#include <cstddef>
#include <tuple>
#include <utility>

#include "simplify/stars.h"

namespace lamina::tiles {
namespace {

template <class T>
void append_all(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

TileMesh merge_tiles(std::vector<TileMesh> parts, int depth) {
  TileMesh all;
  std::vector<SharedVertex> shared;
  all.mesh.layout = parts[0].mesh.layout;
  all.mesh.attributes.resize(all.mesh.layout.size());
  std::size_t vertices = 0, triangles = 0;
  for (const TileMesh& part : parts) {
    vertices += part.mesh.positions.size();
    triangles += part.mesh.triangles.size();
  }
  all.mesh.positions.reserve(vertices);
  all.mesh.normals.reserve(vertices);
  for (auto& values : all.mesh.attributes) values.reserve(vertices);
  all.mesh.triangles.reserve(triangles);
  for (TileMesh& part : parts) {
    const auto first = static_cast<std::uint32_t>(all.mesh.positions.size());
    for (SharedVertex v : part.shared) {
      v.at += first;
      shared.push_back(v);
    }
    append_all(all.mesh.positions, part.mesh.positions);
    append_all(all.mesh.normals, part.mesh.normals);
    for (std::size_t a = 0; a < all.mesh.attributes.size(); ++a)
      append_all(all.mesh.attributes[a], part.mesh.attributes[a]);
    for (auto t : part.mesh.triangles) {
      for (std::uint32_t& v : t) v += first;
      all.mesh.triangles.push_back(t);
    }
    all.error = std::max(all.error, part.error);
    part = {};
  }
  std::sort(shared.begin(), shared.end(),
            [](const SharedVertex& a, const SharedVertex& b) { return std::tie(a.id, a.at) < std::tie(b.id, b.at); });
  std::vector<std::uint32_t> becomes(all.mesh.positions.size());
  for (std::uint32_t v = 0; v < becomes.size(); ++v) becomes[v] = v;
  for (std::size_t i = 0; i < shared.size(); ++i) {
    if (i > 0 && shared[i].id == shared[i - 1].id) {
      becomes[shared[i].at] = becomes[shared[i - 1].at];
    } else if (shared[i].depth < depth) {
      all.shared.push_back(shared[i]);
    }
  }
  for (auto& t : all.mesh.triangles) {
    for (std::uint32_t& v : t) v = becomes[v];
  }
  return all;
}

void coarsen_tile(TileMesh& tile, std::uint64_t triangles, simplify::PartSimplifier& simplifier,
                  const RunContext& run) {
  std::vector<std::uint8_t> locked(tile.mesh.positions.size(), 0);
  for (const SharedVertex& v : tile.shared) locked[v.at] = 1;
  const simplify::PartResult result = simplifier.simplify(tile.mesh, locked, triangles, run);
  for (auto& position : tile.mesh.positions) {
    for (double& c : position) c = std::nearbyint(c);
  }
  std::size_t kept = 0;
  for (const SharedVertex& v : tile.shared) {
    if (result.numbers[v.at] == simplify::kNone) continue;
    tile.shared[kept] = v;
    tile.shared[kept++].at = result.numbers[v.at];
  }
  tile.shared.resize(kept);
  tile.error += result.deviation;
}

}  // namespace lamina::tiles
