#include "lamina/simplify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/descriptor.h"
#include "base/run.h"
#include "lamina/error.h"
#include "lamina/measure.h"
#include "measure/edge_table.h"
#include "meshes/formats.h"
#include "meshes/mesh_blocks.h"
#include "meshes/mesh_sink.h"
#include "meshes/stored_mesh.h"
#include "simplify/matching.h"
#include "simplify/rounds.h"
#include "simplify/streamed.h"

namespace lamina {
namespace simplify {

void require_goal(const SimplifySettings& s) {
  const int given =
      (s.triangles > 0 ? 1 : 0) + (s.error != 0 ? 1 : 0) + (s.ratio != 0 ? 1 : 0) + (s.deviation != 0 ? 1 : 0);
  if (s.error != 0 && !(s.error > 0 && std::isfinite(s.error)))
    throw Error(ExitCode::usage, fmt::format("simplify: an error of {:g}: a length above 0 is meant", s.error));
  if (s.ratio != 0 && !(s.ratio > 0 && s.ratio <= 1))
    throw Error(ExitCode::usage,
                fmt::format("simplify: a ratio of {:g}: a share above 0 and up to 1 is meant", s.ratio));
  if (s.deviation != 0 && !(s.deviation > 0 && s.deviation <= 1)) {
    throw Error(ExitCode::usage,
                fmt::format("simplify: a deviation of {:g}: lengths of an edge above 0 and up to 1 are "
                            "meant",
                            s.deviation));
  }
  if (given == 0) throw Error(ExitCode::usage, "simplify: at least one triangle has to stay");
  if (given > 1)
    throw Error(ExitCode::usage, "simplify: one of a number of triangles, a ratio, an error and a deviation, not both");
}

std::uint64_t wanted_triangles(const SimplifySettings& settings, std::uint64_t there) {
  if (settings.error > 0 || settings.deviation > 0) return 0;
  if (settings.ratio > 0)
    return static_cast<std::uint64_t>(std::max(1.0, std::floor(settings.ratio * static_cast<double>(there))));
  if (settings.triangles > there) {
    throw Error(ExitCode::usage,
                fmt::format("simplify: {} triangles are wanted, the mesh has {}", settings.triangles, there));
  }
  return settings.triangles;
}

SimplifySettings goal_for(const SimplifySettings& settings, std::uint64_t there, const RunContext& run) {
  if (settings.triangles <= there) return settings;
  run.warn(fmt::format("the mesh has {} triangles, no more than the {} that were wanted: it stays as it is", there,
                       settings.triangles));
  return {.ratio = 1};
}

}  // namespace simplify

namespace {

void require_manifold(const TriangleMesh& mesh, const RunContext& run) {
  const CheckReport r = check_mesh(mesh, run);
  if (r.manifold()) return;
  throw Error(ExitCode::unreadable,
              fmt::format("simplify: the mesh is not manifold ({} edges, {} vertices, {} edges between triangles of "
                          "opposite sides, {} triangles there twice, {} without three vertices); 'lamina check' tells "
                          "more",
                          r.non_manifold_edges, r.non_manifold_vertices, r.inconsistent_edges, r.duplicate_triangles,
                          r.repeated_index_triangles));
}

void append(TriangleMesh& all, const TriangleMesh& piece) {
  const auto add = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  add(all.positions, piece.positions);
  add(all.normals, piece.normals);
  for (std::size_t a = 0; a < all.attributes.size(); ++a) add(all.attributes[a], piece.attributes[a]);
  add(all.triangles, piece.triangles);
}

SimplifyStats simplify_in_blocks(TriangleMesh& mesh, const SimplifySettings& settings, const RunContext& run) {
  meshes::HeldMesh blocks(mesh);
  TriangleMesh fewer;
  fewer.layout = mesh.layout;
  fewer.attributes.resize(mesh.attributes.size());
  const SimplifyStats stats = simplify::simplify_blocks(
      blocks, settings, run.tmp_dir.empty() ? system_tmp_dir() : run.tmp_dir,
      [&](const TriangleMesh& piece) { append(fewer, piece); }, run);
  mesh = std::move(fewer);
  return stats;
}

}  // namespace

SimplifyStats simplify_mesh(TriangleMesh& mesh, const SimplifySettings& settings, const RunContext& run) {
  simplify::require_goal(settings);
  SimplifyStats stats;
  if (settings.deviation > 0) require_manifold(mesh, run);
  if (settings.deviation > 0 || mesh.triangles.size() > simplify::kRegionTriangles) {
    with_threads(run.threads, [&] { stats = simplify_in_blocks(mesh, settings, run); });
    return stats;
  }
  require_manifold(mesh, run);
  const std::uint64_t wanted = simplify::wanted_triangles(settings, mesh.triangles.size());
  stats.triangles_before = mesh.triangles.size();
  with_threads(run.threads, [&] {
    simplify::WorkMesh work = simplify::make_work_mesh(mesh, measure::EdgeTable(mesh));
    work.bound = settings.error;
    stats.contractions =
        settings.error > 0 ? simplify::contract_within(work, run) : simplify::contract_to(work, wanted, run);
    stats.deviation = work.deviation;
  });
  simplify::drop_unused(mesh);
  stats.triangles_after = mesh.triangles.size();
  stats.vertices_after = mesh.positions.size();
  stats.reached = settings.error > 0 || stats.triangles_after <= wanted;
  return stats;
}

std::optional<SimplifyStats> simplify_file(const std::string& path, const std::vector<std::string>& outputs,
                                           const SimplifySettings& settings, const RunContext& run) {
  const std::optional<meshes::StoredPly> ply = meshes::open_stored_ply(path);
  if (!ply) return std::nullopt;
  simplify::require_goal(settings);
  if (const std::uint64_t bytes = simplify::memory_for(settings, ply->mesh.triangles);
      run.max_memory > 0 && bytes > run.max_memory) {
    throw Error(ExitCode::budget, fmt::format("{}: simplifying {} triangles needs about {} MB of memory, the limit is "
                                              "{} MB; give it more",
                                              path, ply->mesh.triangles, bytes >> 20U, run.max_memory >> 20U));
  }
  MeshSinkSettings layout = ply->layout;
  layout.path = outputs.at(0);
  layout.more_paths.assign(outputs.begin() + 1, outputs.end());
  layout.tmp_dir = run.tmp_dir;
  if (const std::string crs = meshes::crs_of_ply(path); !crs.empty()) layout.comments.push_back("crs " + crs);
  meshes::warn_of_losses(layout, run);
  SimplifyStats stats;
  with_threads(run.threads, [&] {
    const auto blocks = stored_blocks(ply->mesh, ply->layout, run);
    stats = simplify::write_simplified(*blocks, settings, layout, run);
  });
  return stats;
}

}  // namespace lamina
