#include "lamina/chunk.h"

#include <fmt/format.h>
#include <filesystem>

#include "base/staged_folder.h"
#include "chunks/cuts.h"
#include "chunks/part_file.h"
#include "lamina/error.h"
#include "reconstruct/job.h"
#include "reconstruct/kept_input.h"

namespace lamina {

bool is_store(const std::string& input) {
  return is_kept_input(input);
}

SurfaceStats write_store(const SurfaceSettings& settings, const std::string& store, const RunContext& run) {
  SurfaceSettings own = settings;
  own.dry_run = true;  // nothing but the store is written
  own.output.clear();
  check_settings(own);
  own.dry_run = false;
  RunContext here = run;
  if (here.tmp_dir.empty()) here.tmp_dir = (std::filesystem::absolute(store) / "..").lexically_normal().string();
  Job job(here);
  StagedFolder folder(store);
  run_in_arena(run, [&] {
    const StoredCloud cloud = read_cloud(own, {folder.hidden(), /*stays=*/true}, job);
    plan_surface(own, cloud, job);
    job.watch.time("store", [&] { save_input(cloud, own, folder.hidden()); });
  });
  folder.publish();
  job.finish();
  return job.stats;
}

namespace {

constexpr int kMostChunks = 100000;

ChunkStats run_chunk(const SurfaceSettings& settings, const Chunk& chunk, Job& job) {
  ChunkStats stats;
  StoredCloud cloud = open_kept_input(settings.input, settings);
  const ReconstructionPlan plan = plan_surface(settings, cloud, job);
  const SlabStore& store = cloud.ingested.store;
  const SlabSpan span = cut(plan, store, chunk.count)[static_cast<std::size_t>(chunk.number - 1)];
  stats.first_slab = span.begin - plan.slabs.begin;
  stats.slabs = span.size();
  stats.all_slabs = plan.slabs.size();
  PartSlabs parts({{chunk.number, span, settings.output}}, chunk.count,
                  job_hash(settings, kept_input_id(settings.input), plan), plan.holes, plan.simplify.deviation,
                  mesh_layout(plan));
  if (!span.empty()) {
    stats.overlap_slabs = plan.stages_of(span).of(Stage::project).size() - stats.slabs;
    stats.samples = samples_in(plan, store, span);
    sweep(plan, cloud, span, {parts}, job);
  }
  job.watch.time("commit", [&] { parts.finish(); });
  job.stats.vertices = parts.vertices();
  job.stats.triangles = parts.triangles();
  job.finish();
  stats.surface = job.stats;
  return stats;
}

}  // namespace

ChunkStats reconstruct_chunk(const SurfaceSettings& settings, const Chunk& chunk, const RunContext& run) {
  check_settings(settings);
  require_mesh_alone(settings, "--chunk");
  if (settings.simplify.wanted()) {
    throw Error(ExitCode::usage,
                "--chunk makes a part of a mesh: give --triangles, --ratio or --error to 'lamina merge', which joins "
                "the parts");
  }
  if (chunk.count < 1 || chunk.count > kMostChunks || chunk.number < 1 || chunk.number > chunk.count) {
    throw Error(ExitCode::usage, fmt::format("--chunk {}/{}: must be i/n with 1 <= i <= n <= {}", chunk.number,
                                             chunk.count, kMostChunks));
  }
  if (!names_kept_input(settings)) {
    throw Error(ExitCode::usage, fmt::format("{}: is no store; --chunk works on one that 'lamina sort IN... --store "
                                             "DIR' has made",
                                             settings.input));
  }
  Job job(run);
  ChunkStats stats;
  run_in_arena(run, [&] { stats = run_chunk(settings, chunk, job); });
  return stats;
}

}  // namespace lamina
