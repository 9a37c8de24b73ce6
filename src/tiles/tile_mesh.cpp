#include "tiles/tile_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <tuple>
#include <utility>

#include "lamina/error.h"
#include "measure/edge_table.h"
#include "meshes/mesh_blocks.h"
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

TileSource::TileSource(meshes::MeshBlocks& mesh, const TileOctree& octree, const std::string& tmp_dir,
                       const RunContext& run)
    : mesh_(mesh), octree_(octree), leaves_(octree.nodes().size(), tmp_dir) {
  read(run);
}

void TileSource::read(const RunContext& run) {
  meshes::VertexHomes leaves(mesh_, [this](const meshes::Vec3& at) { return octree_.leaf_at(at); });
  std::uint64_t seen = 0;
  meshes::for_triangles(mesh_, [&](const Corners& t) {
    if (++seen % (1U << 20) == 0 && run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    if (std::max({t[0], t[1], t[2]}) >= mesh_.vertices()) {
      throw Error(ExitCode::unreadable, fmt::format("tiles: triangle {} names vertex {}, the mesh has {}", seen - 1,
                                                    std::max({t[0], t[1], t[2]}), mesh_.vertices()));
    }
    if (measure::repeats_index(t)) {
      ++left_out_;
      return;
    }
    add(t, {leaves.of(t[0]), leaves.of(t[1]), leaves.of(t[2])});
  });
  leaves_.finish();
  settle_shared();
}

void TileSource::add(const Corners& corners, const std::array<std::uint32_t, 3>& homes) {
  const std::uint32_t node = meshes::bin_of_triangle(homes);
  leaves_.add(node, corners);
  ++triangles_;
  for (std::size_t k = 0; k < 3; ++k) {
    if (homes[k] == node) continue;
    // Most likely it has triangles at home as well.
    uses_.push_back({corners[k], node});
    uses_.push_back({corners[k], homes[k]});
  }
  if (uses_.size() >= most_uses_) forget_repeated();
}

void TileSource::forget_repeated() {
  std::sort(uses_.begin(), uses_.end());
  uses_.erase(std::unique(uses_.begin(), uses_.end()), uses_.end());
  most_uses_ = std::max(most_uses_, 2 * uses_.size());
}

void TileSource::settle_shared() {
  forget_repeated();
  for (std::size_t i = 0; i < uses_.size();) {
    const std::uint32_t vertex = uses_[i].vertex;
    std::uint32_t common = uses_[i].leaf;
    for (; i < uses_.size() && uses_[i].vertex == vertex; ++i) common = octree_.common(common, uses_[i].leaf);
    shared_.emplace_back(vertex, octree_.nodes()[common].depth);
  }
  uses_ = {};
}

TileMesh TileSource::leaf(std::uint32_t node, const TileLattice& lattice) {
  TileMesh tile;
  tile.mesh.triangles = leaves_.read(node);
  meshes::VertexNumbers numbers(tile.mesh.triangles);
  for (Corners& t : tile.mesh.triangles) {
    for (std::uint32_t& v : t) v = numbers.of(v);
  }
  const std::vector<std::uint32_t> ids = numbers.vertices();
  auto from = shared_.begin();
  for (std::uint32_t v = 0; v < ids.size(); ++v) {
    from = std::lower_bound(from, shared_.end(), ids[v],
                            [](const auto& entry, std::uint32_t id) { return entry.first < id; });
    if (from == shared_.end()) break;
    if (from->first == ids[v]) tile.shared.push_back({v, ids[v], from->second});
  }
  read_vertices(ids, lattice, tile.mesh);
  return tile;
}

void TileSource::read_vertices(const std::vector<std::uint32_t>& ids, const TileLattice& lattice, TriangleMesh& out) {
  out.layout = mesh_.layout();
  out.attributes.resize(out.layout.size());
  out.positions.reserve(ids.size());
  out.normals.reserve(ids.size());
  for (auto& values : out.attributes) values.reserve(ids.size());
  const auto read = [&](std::uint64_t first, std::size_t count, TriangleMesh& rows) {
    const std::lock_guard lock(reading_);
    mesh_.read_vertices(first, count, rows);
  };
  meshes::for_vertex_rows(ids, read, [&](const TriangleMesh& rows, std::size_t row) {
    out.positions.push_back(lattice.steps(rows.positions[row]));
    out.normals.push_back(rows.normals[row]);
    for (std::size_t a = 0; a < out.attributes.size(); ++a) out.attributes[a].push_back(rows.attributes[a][row]);
  });
}

}  // namespace lamina::tiles
