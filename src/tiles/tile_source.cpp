#include "tiles/tile_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "lamina/error.h"
#include "measure/edge_table.h"
#include "meshes/mesh_blocks.h"
#include "meshes/mesh_pieces.h"

namespace lamina::tiles {

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
