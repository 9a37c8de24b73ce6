#include "reconstruct/job.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "base/free_memory.h"
#include "lamina/error.h"
#include "meshes/formats.h"
#include "mls/refit_normals.h"
#include "reconstruct/pipeline.h"
#include "reconstruct/plan.h"

namespace lamina {
namespace {

/// Of the program alone: getrusage() counts what its parent held when it was started, too.
std::uint64_t peak_memory() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::uint64_t kilobytes = 0;
    if (word == "VmHWM:" && status >> kilobytes) return kilobytes * 1024;
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

/// Normals that were not oriented alike tear the surface apart without any other sign.
void warn_of_contradictions(const SurfaceStats& stats, const std::string& input, const RunContext& run) {
  constexpr double kMuch = 0.05;  // scans of thin things have a percent
  const double share =
      stats.corners_seen == 0 ? 0.0 : static_cast<double>(stats.corners_torn) / static_cast<double>(stats.corners_seen);
  if (share < kMuch && stats.torn_share < 4 * kMuch) return;
  run.warn(
      fmt::format("{}: normals contradict each other around {:.0f} % of the surface, {:.0f} % in slab {}: orient "
                  "them alike before (lamina normal --reorient), or expect holes and double sheets",
                  input, 100 * share, 100 * stats.torn_share, stats.torn_slab));
}

/// A few far samples can stretch the lattice until no cell is small enough for the others.
bool is_out_of_reach(const SurfacePlan& plan) {
  // The lattice addresses a million cells either way from its middle: farther samples set the size of the finest.
  constexpr double kManyCells = 1 << 19;
  const double largest = *std::max_element(plan.extent.begin(), plan.extent.end());
  const bool unresolved =
      largest > kManyCells * plan.finest_cell && plan.finest_cell > 2 * plan.blend * plan.radius_high;
  // A surface has many samples in a slab; a sweep through nothing but gaps takes minutes and finds none.
  constexpr std::uint64_t kSlabsPerSample = 8;
  constexpr std::uint64_t kSlabsAnyway = 1000;
  const auto slabs = static_cast<std::uint64_t>(plan.slabs);
  return unresolved || (slabs > kSlabsAnyway && slabs / kSlabsPerSample > plan.samples);
}

/// Options that lower the memory a run takes, mildest first, in words and as settings: what the user gets who adds
/// them. A larger support has larger cells unless these follow r.
std::vector<std::pair<std::string, SurfaceSettings>> smaller_runs(const SurfaceSettings& settings,
                                                                  const SurfacePlan& plan) {
  std::vector<std::pair<std::string, SurfaceSettings>> runs;
  SurfaceSettings s = settings;
  std::string base;
  if (s.window > 1) {
    s.window = 1;
    base = "--window 1";
    runs.emplace_back(base, s);
    base += " ";
  }
  // A lower slab; what is sparser than the coarsest level serves comes out thinner.
  constexpr int kFewestLevels = 3;
  for (int levels = plan.levels - 1; levels >= kFewestLevels; --levels) {
    SurfaceSettings fewer = s;
    fewer.levels = levels;
    runs.emplace_back(fmt::format("{}--levels {}", base, levels), fewer);
  }
  for (const double factor : {1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0}) {
    SurfaceSettings coarser = s;
    if (plan.cell.unit == Length::Unit::influence_radius) {
      coarser.blend = plan.blend * factor;
      if (*coarser.blend <= 64) runs.emplace_back(fmt::format("{}--blend {:g}", base, *coarser.blend), coarser);
    } else {
      coarser.cell = Length{plan.cell.value * factor, plan.cell.unit};
      runs.emplace_back(fmt::format("{}--cell {}", base, to_string(*coarser.cell)), coarser);
    }
  }
  return runs;
}

[[noreturn]] void refuse_memory(const SurfaceSettings& settings, const StoredCloud& cloud, const CloudSurvey& survey,
                                const SurfacePlan& plan, std::uint64_t allowed) {
  const auto mb = [](std::uint64_t bytes) { return static_cast<double>(bytes) / 1e6; };
  std::string remedy;
  for (const auto& [words, changed] : smaller_runs(settings, plan)) {
    const std::uint64_t bytes = make_plan(changed, cloud, survey).expected.memory;
    if (bytes > allowed) continue;
    remedy = fmt::format("; {} would fit ({:.0f} MB)", words, mb(bytes));
    break;
  }
  if (remedy.empty()) remedy = "; give it more, or cut the cloud";
  throw Error(ExitCode::budget, fmt::format("{}: needs about {:.0f} MB of memory, --max-memory allows {:.0f} MB{}",
                                            input_name(settings), mb(plan.memory_bytes), mb(allowed), remedy));
}

/// A GLB of more than 4 GB needs files beside it, which a pipe has none of: better refused before the work than after
/// it.
void refuse_large_glb(const SurfaceSettings& settings, const ReconstructionPlan& plan) {
  constexpr double kVerticesPerFace = 0.5, kSurely = 1.25;
  const double triangles = expected_triangles(plan);
  const std::uint64_t bytes = meshes::glb_data_bytes(plan.mesh_attributes, /*normals=*/true,
                                                     static_cast<std::uint64_t>(kVerticesPerFace * triangles),
                                                     static_cast<std::uint64_t>(triangles));
  if (static_cast<double>(bytes) <= kSurely * static_cast<double>(meshes::GlbLimits{}.file)) return;
  for (const std::string& output : output_names(settings)) {
    std::error_code ignored;
    if (meshes::mesh_format(output) != meshes::MeshFormat::glb || !std::filesystem::is_other(output, ignored)) continue;
    throw Error(ExitCode::budget,
                fmt::format("{}: a single GLB holds at most 4 GB, the mesh would take about {:.1f} GB; write to a "
                            "file, beside which others may lie, or a .ply",
                            output, static_cast<double>(bytes) * 1e-9));
  }
}

/// How long the whole run will take, judging by how fast this machine has read the input.
double expected_seconds(const ReconstructionPlan& plan, const PointSourceInfo& source, int threads, const Job& job) {
  double slowness = 1;
  constexpr std::uint64_t kEnough = 1'000'000;  // fewer are read too fast to tell
  for (const StageTime& s : job.watch.stages()) {
    // Formats that cost more to read say little of the rest.
    if (s.stage == "store" && source.random_access && plan.samples >= kEnough) {
      // Half of reading is the system's copying, which other programs disturb more than computing.
      slowness = std::clamp(std::sqrt(s.cpu / plan.expected.reading_seconds), 0.7, 1.5);
    }
  }
  constexpr double kEfficiency = 0.92;  // of each thread beyond the first
  const double left = plan.expected.cpu_seconds - plan.expected.reading_seconds;
  return job.elapsed() + slowness * left / (1 + kEfficiency * (threads - 1));
}

void note_input(const StoredCloud& cloud, SurfaceStats& stats) {
  const Census& census = cloud.ingested.census;
  stats.samples_read = cloud.info.count;
  stats.crs = cloud.info.crs;
  stats.replaced_attributes = census.unusable_attributes;
  for (int k = 1; k < kDefects; ++k) {
    if (census.rejected[k] > 0)
      stats.rejected.push_back(
          {reason_of(static_cast<Defect>(k), cloud.info), census.rejected[k], census.first_row[k]});
  }
}

}  // namespace

void Job::finish() {
  stats.stages = watch.stages();
  stats.partly_idle = watch.partly_idle();
  const Stopwatch::Moment ended = Stopwatch::now();
  stats.wall = ended.wall - began.wall;
  stats.cpu = ended.cpu - began.cpu;
  stats.threads = tbb::this_task_arena::max_concurrency();
  stats.peak_memory = peak_memory();
}

namespace {

/// `watch`: sees how well the threads are used; none: nobody wants to know.
void work_in_arena(const RunContext& run, Stopwatch* watch, const std::function<void()>& work) {
  const int threads = run.threads > 0 ? run.threads : tbb::this_task_arena::max_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  tbb::task_arena arena(threads);
  std::optional<ThreadWatch> watched;
  if (watch != nullptr) watch->watch(watched.emplace(arena, threads));
  arena.execute(work);
}

}  // namespace

void run_in_arena(const RunContext& run, const std::function<void()>& work) {
  work_in_arena(run, nullptr, work);
}

void run_in_arena(Job& job, const std::function<void()>& work) {
  work_in_arena(job.run, &job.watch, work);
}

ReconstructionPlan plan_surface(const SurfaceSettings& settings, const StoredCloud& cloud, Job& job) {
  CloudSurvey survey;
  std::optional<ReconstructionPlan> made;
  job.watch.time("plan", [&] {
    const SlabStore& store = cloud.ingested.store;
    survey = cloud.survey ? *cloud.survey : survey_cloud(settings, store, reader_of(store));
    made.emplace(make_plan(settings, cloud, survey));
  });
  const ReconstructionPlan& plan = *made;
  SurfacePlan& told = job.stats.plan;
  told = summary_of(plan);
  told.scans = std::max<std::uint64_t>({cloud.info.scans.size(), job.stats.alignment.scans, 1});
  told.overlap = cloud.ingested.overlap;
  told.threads = tbb::this_task_arena::max_concurrency();
  told.seconds = expected_seconds(plan, cloud.info, told.threads, job);
  note_input(cloud, job.stats);
  job.run.info(describe(told));
  job.run.info(describe_findings(settings, job.stats));
  constexpr std::uint64_t kLargestTables = std::uint64_t{1} << 30;  // a scan of 380 million samples needs a few MB
  if (is_out_of_reach(told) || table_bytes(plan, cloud.ingested.store) > kLargestTables) {
    throw Error(ExitCode::empty,
                fmt::format("{}: some of the {} samples lie so far away from the others ({:.3g}, r {:.3g}) that the "
                            "lattice cannot hold both; remove them",
                            plan.input, told.samples, *std::max_element(told.extent.begin(), told.extent.end()),
                            told.radius_median));
  }
  if (job.run.max_memory > 0 && told.memory_bytes > job.run.max_memory)
    refuse_memory(settings, cloud, survey, told, job.run.max_memory);
  refuse_large_glb(settings, plan);
  job.stats.disk_bytes = cloud.ingested.store.disk_bytes();
  return std::move(*made);
}

void sweep(const ReconstructionPlan& plan, StoredCloud& cloud, const SlabSpan& span, const SweepOutput& output,
           Job& job) {
  return_free_memory();
  SampleFeed feed(cloud.ingested.store, plan.lattice, plan.feed, plan.radii, plan.given_radii);
  std::optional<RefitNormals> refit;
  if (plan.refit.support > 0) {
    refit.emplace(plan.refit, plan.lattice, select_kernel());
    feed.filter_normals(*refit);
  }
  Pipeline pipeline(plan, feed, span, output);
  pipeline.run(job.run, job.watch);
  pipeline.report(job.stats);
  warn_of_contradictions(job.stats, plan.input, job.run);
  if (feed.counts().undersampled > 0) {
    job.stats.rejected.push_back({"radius above --max-radius", feed.counts().undersampled, std::nullopt});
    job.run.info(fmt::format("{} of {} samples discarded as undersampled: radius above --max-radius",
                             feed.counts().undersampled, cloud.info.count));
  }
}

void no_surface(const ReconstructionPlan& plan) {
  throw Error(ExitCode::empty,
              fmt::format("{}: no surface came out of {} samples; they lie too far apart for their radii, or on no "
                          "surface at all (try --blend or --particlescale above 1)",
                          plan.input, plan.samples));
}

}  // namespace lamina
