#include "tiles/write_tiles.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/output_file.h"
#include "base/run.h"
#include "base/vectors.h"
#include "lamina/error.h"
#include "meshes/mesh_blocks.h"
#include "meshes/stored_mesh.h"
#include "simplify/matching.h"
#include "tiles/georeference.h"
#include "tiles/tile_mesh.h"
#include "tiles/tile_octree.h"

namespace lamina::tiles {
namespace {

using meshes::Vec3;
using TilesetJson = nlohmann::ordered_json;

/// Boxes of all that is in a tile and below it, children before parents.
std::vector<StepBox> whole_boxes(const Tileset& tileset) {
  std::vector<StepBox> boxes;
  for (const TileEntry& entry : tileset.entries) boxes.push_back(entry.box);
  for (std::size_t node = boxes.size(); node-- > 1;) {
    if (tileset.entries[node].triangles == 0) continue;
    StepBox& above = boxes[tileset.octree.nodes()[node].parent];
    for (std::size_t k = 0; k < 3; ++k) {
      above.low[k] = std::min(above.low[k], boxes[node].low[k]);
      above.high[k] = std::max(above.high[k], boxes[node].high[k]);
    }
  }
  return boxes;
}

/// Middle and half axes.
TilesetJson box_json(const StepBox& box, double step) {
  TilesetJson out = TilesetJson::array();
  for (std::size_t k = 0; k < 3; ++k) out.push_back(step * 0.5 * (box.low[k] + box.high[k]));
  for (std::size_t k = 0; k < 3; ++k) {
    // A flat tile has a thickness all the same: half a step.
    Vec3 axis{};
    axis[k] = step * 0.5 * std::max(1.0, box.high[k] - box.low[k]);
    for (const double c : axis) out.push_back(c);
  }
  return {{"box", std::move(out)}};
}

TilesetJson tile_json(const Tileset& tileset, const std::vector<StepBox>& boxes, std::uint32_t node) {
  const TileEntry& entry = tileset.entries[node];
  const double step = tileset.lattice.step;
  TilesetJson tile;
  tile["boundingVolume"] = box_json(boxes[node], step);
  tile["geometricError"] = step * entry.error;
  if (node == 0) tile["refine"] = "REPLACE";
  tile["content"] = {{"uri", entry.content}};
  tile["extras"] = {{"triangles", entry.triangles}};
  TilesetJson children = TilesetJson::array();
  for (const std::uint32_t child : tileset.octree.nodes()[node].children) {
    if (tileset.entries[child].triangles > 0) children.push_back(tile_json(tileset, boxes, child));
  }
  if (!children.empty()) tile["children"] = std::move(children);
  return tile;
}

}  // namespace

std::string tileset_json(const Tileset& tileset) {
  const std::vector<StepBox> boxes = whole_boxes(tileset);
  const Vec3& origin = tileset.lattice.origin;
  TilesetJson json;
  json["asset"] = {{"version", "1.1"}};
  json["asset"]["extras"] = {{"generator", "lamina " LAMINA_VERSION}, {"origin", origin}};
  if (!tileset.crs.empty()) json["asset"]["extras"]["crs"] = tileset.crs;
  // From this far off nothing of it is to be seen.
  Vec3 diagonal{};
  for (std::size_t k = 0; k < 3; ++k) diagonal[k] = tileset.lattice.step * (boxes[0].high[k] - boxes[0].low[k]);
  json["geometricError"] = std::max(meshes::norm(diagonal), tileset.lattice.step * tileset.entries[0].error);
  json["root"] = tile_json(tileset, boxes, 0);
  const Matrix4 local{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, origin[0], origin[1], origin[2], 1};
  json["root"]["transform"] = tileset.plane ? to_earth(*tileset.plane, origin) : local;
  return json.dump(-1, ' ', false, TilesetJson::error_handler_t::replace) + "\n";
}

TileStats stats_of(const Tileset& tileset) {
  TileStats stats;
  for (std::size_t node = 0; node < tileset.entries.size(); ++node) {
    const TileEntry& entry = tileset.entries[node];
    if (entry.triangles == 0) continue;
    ++stats.tiles;
    stats.bytes += entry.bytes;
    stats.levels = std::max(stats.levels, tileset.octree.nodes()[node].depth + 1);
    if (!tileset.octree.nodes()[node].leaf()) continue;
    ++stats.leaves;
    stats.triangles += entry.triangles;
  }
  stats.error = tileset.lattice.step * tileset.entries[0].error;
  stats.on_earth = tileset.plane.has_value();
  return stats;
}

}  // namespace lamina::tiles

namespace lamina {
namespace tiles {
namespace {

constexpr double kShrinks = 0.25;  ///< of its children's triangles a tile has: edges twice as long
constexpr const char* kContentFolder = "tiles";

/// A leaf is cut by its vertices.
std::uint64_t leaf_vertices(const meshes::MeshBlocks& mesh, double triangles) {
  const double ratio = static_cast<double>(mesh.vertices()) / static_cast<double>(mesh.triangles());
  return static_cast<std::uint64_t>(std::max(3.0, triangles * ratio));
}

/// A leaf of usual size fits 16 bits; of a map's coordinates a step is no more than a millimetre.
TileLattice lattice_of(const Extent& extent, const TileOctree& octree, bool map) {
  std::vector<double> sides;
  for (const TileNode& node : octree.nodes()) {
    if (node.leaf()) sides.push_back(node.side);
  }
  constexpr double kBeside = 1.25;  // triangles reach out of the cells
  constexpr double kWords = 65534, kMostSteps = 1 << 23;
  const double longest = extent.longest();
  TileLattice lattice;
  if (longest > 0) {
    double step = std::exp2(std::floor(std::log2(kBeside * median_of(sides) / kWords)));
    if (map) step = std::min(step, std::exp2(-10));
    lattice.step = std::max(step, std::exp2(std::ceil(std::log2(longest / kMostSteps))));
  }
  // A round origin: nothing is lost when it is taken away or added.
  const double round = longest > 0 ? std::exp2(std::ceil(std::log2(longest)) - 4) : 1;
  const meshes::Vec3 centre = extent.middle();
  for (std::size_t k = 0; k < 3; ++k) lattice.origin[k] = std::nearbyint(centre[k] / round) * round + 0.0;
  return lattice;
}

/// Builds the tiles from the leaves up.
class TileBuilder {
 public:
  TileBuilder(TileSource& source, const TileOctree& octree, const TileLattice& lattice, const TileSizes& sizes,
              bool compress, StagedFolder& folder)
      : source_(source),
        octree_(octree),
        lattice_(lattice),
        sizes_(sizes),
        compress_(compress),
        folder_(folder),
        entries_(octree.nodes().size()) {}

  /// The tile of a node and all below it, written.
  TileMesh build(std::uint32_t node, const RunContext& run) {
    if (run.cancelled() || failed_) throw Error(ExitCode::internal, "cancelled");
    const TileNode& place = octree_.nodes()[node];
    if (place.leaf()) {
      TileMesh tile = source_.leaf(node, lattice_);
      write(node, tile, run);
      return tile;
    }
    TileMesh tile = merge_tiles(build_all(place.children, run), place.depth);
    const auto there = static_cast<double>(tile.mesh.triangles.size());
    const double wanted = std::clamp(kShrinks * there, sizes_.least, sizes_.most);
    if (there > wanted) coarsen_tile(tile, static_cast<std::uint64_t>(wanted), simplifier_, run);
    write(node, tile, run);
    return tile;
  }

  [[nodiscard]] const std::vector<TileEntry>& entries() const { return entries_; }

 private:
  /// An error does not leave the loop before its end: TBB would cancel what goes on inside the other turns, and loops
  /// within them would return with half of their work done.
  std::vector<TileMesh> build_all(const std::vector<std::uint32_t>& nodes, const RunContext& run) {
    std::vector<TileMesh> parts(nodes.size());
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, parts.size(), 1),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t c = range.begin(); c != range.end(); ++c) {
            try {
              parts[c] = build(nodes[c], run);
            } catch (...) {
              keep_failure();
            }
          }
        },
        tbb::simple_partitioner());
    if (failed_) {
      const std::lock_guard lock(failing_);
      std::rethrow_exception(failure_);
    }
    return parts;
  }

  /// The first one is what the run ends with; the tiles that are being built end for it.
  void keep_failure() {
    const std::lock_guard lock(failing_);
    if (!failure_) failure_ = std::current_exception();
    failed_ = true;
  }

  void write(std::uint32_t node, const TileMesh& tile, const RunContext& run) {
    TileEntry& entry = entries_[node];
    entry.triangles = tile.mesh.triangles.size();
    if (entry.triangles > 0) write_content(node, tile);
    const std::lock_guard lock(telling_);
    ++done_;
    if (run.progress) run.progress({"tiles", 0, 0, done_, static_cast<std::int64_t>(entries_.size())});
  }

  void write_content(std::uint32_t node, const TileMesh& tile) {
    TileEntry& entry = entries_[node];
    entry.box = box_of_tile(tile.mesh);
    entry.error = tile.error;
    const std::string& bytes = encoders_.local().content(tile.mesh, lattice_, compress_);
    entry.bytes = bytes.size();
    entry.content = fmt::format("{}/{}.glb", kContentFolder, octree_.nodes()[node].name);
    folder_.write(entry.content, bytes);
  }

  TileSource& source_;
  const TileOctree& octree_;
  const TileLattice& lattice_;
  TileSizes sizes_;
  bool compress_;
  StagedFolder& folder_;
  std::vector<TileEntry> entries_;
  simplify::PartSimplifier simplifier_;
  tbb::enumerable_thread_specific<TileEncoder> encoders_;
  std::mutex telling_;
  std::int64_t done_ = 0;  ///< tiles
  std::mutex failing_;
  std::exception_ptr failure_;
  std::atomic<bool> failed_ = false;
};

std::string temporary_folder_of(const TileSettings& settings, const RunContext& run) {
  if (!run.tmp_dir.empty()) return run.tmp_dir;
  const auto parent = std::filesystem::path(settings.folder).lexically_normal().parent_path();
  return parent.empty() ? "." : parent.string();
}

}  // namespace

TileStats write_blocks_as_tiles(meshes::MeshBlocks& mesh, const TileSettings& settings, const RunContext& run,
                                const TileSizes& sizes) {
  if (mesh.triangles() == 0) {
    throw Error(ExitCode::unreadable,
                mesh.vertices() > 0
                    ? "tiles: there are no triangles, only points; 'lamina surface' makes a mesh of them"
                    : "tiles: the mesh is empty");
  }
  StagedFolder folder(settings.folder);
  folder.make_folder(kContentFolder);
  const Extent extent = extent_of(mesh);
  const TileOctree octree(mesh, extent, leaf_vertices(mesh, sizes.leaf));
  const std::optional<MapPlane> plane = map_plane(settings.crs);
  const TileLattice lattice = lattice_of(extent, octree, !settings.crs.empty());
  TileSource source(mesh, octree, temporary_folder_of(settings, run), run);
  if (source.triangles() == 0)
    throw Error(ExitCode::unreadable, "tiles: every triangle of the mesh names a vertex twice");
  if (source.left_out() > 0)
    run.warn(fmt::format("tiles: {} triangles that name a vertex twice are left out", source.left_out()));
  if (!settings.crs.empty() && !plane)
    run.info("tiles: the coordinate system is no transverse Mercator that is known; tiles have local coordinates");
  TileBuilder builder(source, octree, lattice, sizes, settings.compress, folder);
  builder.build(0, run);
  const Tileset tileset{octree, builder.entries(), lattice, settings.crs, plane};
  folder.write("tileset.json", tileset_json(tileset));
  folder.publish();
  return stats_of(tileset);
}

}  // namespace tiles

TileStats write_tiles(const TriangleMesh& mesh, const TileSettings& settings, const RunContext& run) {
  TileStats stats;
  with_threads(run.threads, [&] {
    if (!mesh.normals.empty() || mesh.triangles.empty()) {
      meshes::HeldMesh blocks(mesh);
      stats = tiles::write_blocks_as_tiles(blocks, settings, run);
      return;
    }
    TriangleMesh with_normals = mesh;
    with_normals.normals = meshes::vertex_normals(mesh);
    meshes::HeldMesh blocks(with_normals);
    stats = tiles::write_blocks_as_tiles(blocks, settings, run);
  });
  return stats;
}

std::optional<TileStats> write_tiles_of_file(const std::string& path, const TileSettings& settings,
                                             const RunContext& run) {
  const std::optional<meshes::StoredPly> ply = meshes::open_stored_ply(path);
  if (!ply) return std::nullopt;
  TileStats stats;
  with_threads(run.threads, [&] {
    const auto blocks = stored_blocks(ply->mesh, ply->layout, run);
    stats = tiles::write_blocks_as_tiles(*blocks, settings, run);
  });
  return stats;
}

std::string crs_of_mesh(const std::string& path) {
  return meshes::crs_of_ply(path);
}

}  // namespace lamina
