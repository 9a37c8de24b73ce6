#include "lamina/surface.h"

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "base/free_memory.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "levelset/surface_volume.h"
#include "meshes/formats.h"
#include "meshes/mesh_sink.h"
#include "reconstruct/job.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/plan.h"
#include "reconstruct/pruner.h"
#include "reconstruct/stored_cloud.h"
#include "simplify/streamed.h"
#include "tiles/write_tiles.h"

namespace lamina {
namespace {

void report_pruning(const PruneCounts& counts, const std::string& name, Job& job) {
  job.stats.pruned = counts;
  if (counts.kept == 0 && counts.removed > 0) {
    throw Error(ExitCode::empty, fmt::format("{}: all {} connected parts of the mesh are too small for --prune or "
                                             "--prune-size; --prune 0 keeps them",
                                             name, counts.removed));
  }
  if (counts.removed == 0 && counts.kept <= 1) return;
  job.run.info(fmt::format("{} connected parts, {} small ones left out with {} triangles", counts.kept, counts.removed,
                           counts.removed_triangles));
}

/// On their way to a mesh file, small parts are left out.
class PrunedSlabs final : public SlabSink {
 public:
  explicit PrunedSlabs(Pruner& pruner) : pruner_(pruner) {}
  void write(const MeshSlab& slab) override { pruner_.add(slab.vertices, slab.triangles); }

 private:
  Pruner& pruner_;
};

/// Tiles that cannot be written do not keep the mesh from being: what was wrong with them.
std::optional<Error> write_tiles_beside(const ReconstructionPlan& plan, MeshSink* sink, Job& job) {
  if (plan.tiles.folder.empty() || sink == nullptr) return std::nullopt;
  try {
    const auto write = [&](meshes::MeshBlocks& mesh) {
      job.stats.tiles = tiles::write_blocks_as_tiles(mesh, plan.tiles, job.run);
    };
    job.watch.time("tiles", [&] { sink->read_back(write, job.run); });
  } catch (const Error& error) {
    if (job.run.cancelled()) throw;
    return error;
  }
  return std::nullopt;
}

/// The mesh as the sweep has left it becomes one of fewer triangles, which goes where that was to go.
std::unique_ptr<WholeMesh> simplified(const ReconstructionPlan& plan, MeshSink& full, const MeshSinkSettings& layout,
                                      MeshReceiver* receiver, Job& job) {
  return_free_memory();
  std::unique_ptr<WholeMesh> fewer = open_whole_mesh(layout, receiver);
  MeshSlab slab;
  const auto take = [&](TriangleMesh piece) {
    take_vertices(piece, 0, piece.positions.size(), slab.vertices);
    slab.triangles = std::move(piece.triangles);
    fewer->write(slab);
    ++slab.slab;
  };
  job.watch.time("simplify", [&] {
    const SimplifySettings goal = simplify::goal_for(plan.simplify, full.triangles(), job.run);
    full.read_back(
        [&](meshes::MeshBlocks& mesh) {
          job.stats.simplified = simplify::simplify_blocks(mesh, goal, full.tmp_dir(), take, job.run);
        },
        job.run);
  });
  return fewer;
}

/// The mesh of a plan into its files, whose names and folder `layout` has, or to the receiver.
void write_surface(const ReconstructionPlan& plan, StoredCloud& cloud, const MeshSinkSettings& layout,
                   MeshReceiver* receiver, Job& job) {
  if (receiver == nullptr) meshes::warn_of_losses(layout, job.run);
  MeshSinkSettings swept = layout;
  if (plan.simplify.wanted()) {
    swept.path = simplify::unsimplified_path(layout);
    swept.more_paths.clear();
  }
  std::unique_ptr<WholeMesh> whole = open_whole_mesh(swept, plan.simplify.wanted() ? nullptr : receiver);
  std::optional<SurfaceVolume> volume;
  if (plan.volume.wanted())
    volume.emplace(plan.volume, plan.frame, plan.lattice, plan.main_level, plan.attributes, layout.tmp_dir);
  ClosingSlabs closing(plan.holes, layout, *whole);
  Pruner pruner(plan.pruning, layout.tmp_dir, closing);
  PrunedSlabs pruned(pruner);
  const bool prunes = plan.pruning.wanted();
  SlabSink& mesh = prunes ? static_cast<SlabSink&>(pruned) : closing;
  sweep(plan, cloud, plan.slabs, {mesh, volume ? &*volume : nullptr}, job);
  if (prunes) {
    job.watch.time("cluster and write", [&] { pruner.finish(); });
    report_pruning(pruner.counts(), plan.input, job);
  }
  job.watch.time("holes", [&] { job.stats.holes = close_holes(closing, *whole); });
  if (whole->triangles() == 0) no_surface(plan);
  if (volume) {
    job.watch.time("volume", [&] { volume->finish(/*open=*/job.stats.rejected_loops > 0); });
    volume->commit();
    job.stats.volume = volume->stats();
  }
  if (plan.simplify.wanted()) whole = simplified(plan, *whole->files(), layout, receiver, job);
  const std::optional<Error> no_tiles = write_tiles_beside(plan, whole->files(), job);
  job.watch.time("commit", [&] { whole->commit(job.run); });
  job.stats.vertices = whole->vertices();
  job.stats.triangles = whole->triangles();
  if (no_tiles) throw Error(*no_tiles);
}

void reconstruct(const SurfaceSettings& settings, Job& job) {
  MeshSinkSettings out;
  out.path = settings.output;
  out.more_paths = settings.more_outputs;
  out.tmp_dir = temporary_directory(settings, job.run);
  // An output that cannot be written is better known now than after the input has been read.
  if (!settings.dry_run && !settings.receiver) {
    const MeshSink trial(out);
    if (!settings.tiles.folder.empty()) const StagedFolder folder(settings.tiles.folder);
  }
  if (!settings.dry_run) try_rejected(settings);
  StoredCloud cloud = read_cloud(settings, out.tmp_dir, job);
  if (settings.local) {
    shift_to_origin(cloud);
    job.stats.shift = *cloud.shift;
    if (!settings.dry_run) job.run.info(fmt::format("coordinates are written less {}", shift_text(*cloud.shift)));
  }
  const ReconstructionPlan plan = plan_surface(settings, cloud, job);
  if (!settings.dry_run) {
    MeshSinkSettings layout = mesh_layout(plan);
    layout.path = out.path;
    layout.more_paths = out.more_paths;
    layout.tmp_dir = out.tmp_dir;
    write_surface(plan, cloud, layout, settings.receiver.get(), job);
    if (job.rejected) job.rejected->commit();
  }
  job.finish();
}

}  // namespace

SurfaceStats reconstruct_surface(const SurfaceSettings& settings, const RunContext& run) {
  check_settings(settings);
  require_two_files(settings);
  Job job(run);
  run_in_arena(job, [&] { reconstruct(settings, job); });
  return job.stats;
}

}  // namespace lamina
