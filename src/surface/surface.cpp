#include "lamina/surface.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <filesystem>

#include "lamina/error.h"
#include "lamina/mesh_sink.h"
#include "lamina/points.h"
#include "lamina/version.h"
#include "surface/ingest.h"
#include "surface/pipeline.h"
#include "surface/plan.h"
#include "surface/stopwatch.h"
#include "surface/survey.h"

namespace lamina {
namespace {

std::uint64_t peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

/// Next to the output unless told otherwise; the system's temporary folder for standard output.
std::string temporary_directory(const SurfaceSettings& settings, const RunContext& run) {
  if (!run.tmp_dir.empty()) return run.tmp_dir;
  if (settings.output.empty() || settings.output == "-") return std::filesystem::temp_directory_path().string();
  const std::string parent = std::filesystem::path(settings.output).parent_path().string();
  return parent.empty() ? "." : parent;
}

/// Float positions keep a hundredth of a cell as long as the coordinates are below some ten thousand cells;
/// georeferenced ones are not.
bool needs_double(const Survey& survey, double finest_cell) {
  const double largest = std::max(survey.low.cwiseAbs().maxCoeff(), survey.high.cwiseAbs().maxCoeff());
  return largest * 0x1p-24 > 0.01 * finest_cell;
}

SurfaceStats reconstruct(const SurfaceSettings& settings, const RunContext& run) {
  SurfaceStats stats;
  Stopwatch watch;
  const Stopwatch::Moment began = Stopwatch::now();
  const std::string tmp = temporary_directory(settings, run);

  const std::unique_ptr<PointSource> source = open_points(settings.input, tmp);
  const PointSourceInfo& info = source->info();
  Survey survey;
  watch.time("survey", [&] { survey = survey_input(*source, settings.bad_samples, run); });
  const Frame frame = choose_frame(survey, settings.frame);
  std::optional<Ingested> ingested;
  watch.time("store", [&] { ingested.emplace(ingest(*source, survey, frame, settings.radius_scale, tmp, run)); });
  const Resolved resolved =
      resolve_plan(settings, frame, ingested->store, ingested->extent, info.has_radius, info.attributes.size());
  stats.plan = resolved.plan;
  stats.samples_read = info.count;
  for (int k = 1; k < kDefects; ++k) {
    if (survey.rejected[k] > 0) {
      stats.rejected.push_back({describe(static_cast<Defect>(k)), survey.rejected[k], survey.first_row[k]});
    }
  }
  run.info(describe(resolved.plan, settings));

  if (!settings.dry_run) {
    MeshSinkSettings out;
    out.path = settings.output;
    out.tmp_dir = tmp;
    out.attributes = info.attributes;
    out.double_positions = needs_double(survey, resolved.plan.finest_cell);
    out.comments = {fmt::format("made by lamina {}", version())};
    MeshSink sink(out);
    SampleFeed feed(ingested->store, resolved.lattice, resolved.feed, resolved.radii, info.has_radius);
    Pipeline pipeline(settings, resolved, frame, ingested->extent, feed, info.attributes.size(), sink);
    pipeline.run(run, watch);
    pipeline.report(stats);
    if (feed.counts().undersampled > 0) {
      stats.rejected.push_back({"radius above --max-radius", feed.counts().undersampled, 0});
    }
    if (sink.triangles() == 0) {
      throw Error(ExitCode::empty,
                  fmt::format("{}: no surface came out; the samples lie too far apart for their radii (try "
                              "--blend or --particlescale above 1)",
                              settings.input));
    }
    watch.time("commit", [&] { sink.commit(); });
    stats.vertices = sink.vertices();
    stats.triangles = sink.triangles();
  }
  stats.disk_bytes = ingested->store.disk_bytes();
  stats.stages = watch.stages();
  const Stopwatch::Moment ended = Stopwatch::now();
  stats.wall = ended.wall - began.wall;
  stats.cpu = ended.cpu - began.cpu;
  stats.peak_memory = peak_memory();
  return stats;
}

}  // namespace

SurfaceStats reconstruct_surface(const SurfaceSettings& settings, const RunContext& run) {
  check_settings(settings);
  const int threads = run.threads > 0 ? run.threads : tbb::this_task_arena::max_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  tbb::task_arena arena(threads);
  SurfaceStats stats;
  arena.execute([&] { stats = reconstruct(settings, run); });
  return stats;
}

}  // namespace lamina
