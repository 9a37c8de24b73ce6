#include "lamina/surface.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <vector>

#include "base/descriptor.h"
#include "lamina/error.h"
#include "lamina/points.h"
#include "levelset/surface_volume.h"
#include "meshes/mesh_sink.h"
#include "mls/refit_normals.h"
#include "reconstruct/choose_normals.h"
#include "reconstruct/closing_slabs.h"
#include "reconstruct/kept_input.h"
#include "reconstruct/local_shift.h"
#include "reconstruct/pipeline.h"
#include "reconstruct/plan.h"
#include "reconstruct/pruner.h"
#include "reconstruct/stopwatch.h"
#include "reconstruct/sweep.h"
#include "samples/clean_ingested.h"
#include "store/ingest.h"
#include "store/survey.h"

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

/// Float positions keep a hundredth of a cell as long as the coordinates are below some ten thousand cells;
/// georeferenced ones are not. Nor can float hold the very large and the very small.
bool needs_double(const Census& census, double finest_cell) {
  constexpr double kLargest = 1e37;
  constexpr double kSmallestCell = 1e-35;
  const double largest = std::max(census.low.cwiseAbs().maxCoeff(), census.high.cwiseAbs().maxCoeff());
  return largest * 0x1p-24 > 0.01 * finest_cell || largest > kLargest || finest_cell < kSmallestCell;
}

std::string input_name(const SurfaceSettings& settings) {
  return settings.input == "-" ? "standard input" : settings.input;
}

/// A few far samples can stretch the lattice until no cell is small enough for the others.
bool is_out_of_reach(const SurfacePlan& plan, double blend) {
  // The lattice addresses a million cells either way from its middle: farther samples set the size of the finest.
  constexpr double kManyCells = 1 << 19;
  const double largest = *std::max_element(plan.extent.begin(), plan.extent.end());
  const bool unresolved = largest > kManyCells * plan.finest_cell && plan.finest_cell > 2 * blend * plan.radius_high;
  // A surface has many samples in a slab; a sweep through nothing but gaps takes minutes and finds none.
  constexpr std::uint64_t kSlabsPerSample = 8;
  constexpr std::uint64_t kSlabsAnyway = 1000;
  const auto slabs = static_cast<std::uint64_t>(plan.slabs);
  return unresolved || (slabs > kSlabsAnyway && slabs / kSlabsPerSample > plan.samples);
}

/// The window's look-up tables cover all the slabs a bucket of samples lies in, empty ones too: next to nothing, unless
/// a few samples are scattered over a long way.
std::uint64_t table_bytes(const Lattice& lattice, const Ingested& in) {
  double tallest = 0;
  for (std::size_t b = 0; b < in.store.buckets(); ++b) {
    if (in.store.count(b) > 0)
      tallest = std::max(tallest, static_cast<double>(in.store.z_upper(b)) - in.store.z_lower(b));
  }
  constexpr double kLargestTable = 1 << 22;
  double entries = 0;  // of a slab
  for (int level = 0; level < lattice.levels; ++level) {
    const double block = 8.0 * lattice.cell_size(level);
    const double table = (static_cast<double>(in.extent.x_max) - in.extent.x_min + 3 * block) / block *
                         (static_cast<double>(in.extent.y_max) - in.extent.y_min + 3 * block) / block;
    if (table <= kLargestTable) entries += table * lattice.layers(level) / 8;
  }
  return static_cast<std::uint64_t>(tallest / lattice.slab_height() * entries * sizeof(void*));
}

/// Changes that lower the memory a run takes, mildest first. A larger support has larger cells unless these follow r.
std::vector<std::pair<std::string, SurfaceSettings>> smaller_runs(const SurfaceSettings& settings, int levels_now) {
  std::vector<std::pair<std::string, SurfaceSettings>> runs;
  SurfaceSettings s = settings;  // of support and cells, what was chosen
  std::string base;
  if (s.window > 1) {
    s.window = 1;
    base = "--window 1";
    runs.emplace_back(base, s);
    base += " ";
  }
  // A lower slab; what is sparser than the coarsest level serves comes out thinner.
  constexpr int kFewestLevels = 3;
  for (int levels = levels_now - 1; levels >= kFewestLevels; --levels) {
    SurfaceSettings fewer = s;
    fewer.levels = levels;
    runs.emplace_back(fmt::format("{}--levels {}", base, levels), fewer);
  }
  for (const double factor : {1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0}) {
    SurfaceSettings coarser = s;
    if (s.cell->unit == Length::Unit::influence_radius) {
      coarser.blend = *s.blend * factor;
      if (*coarser.blend <= 64) runs.emplace_back(fmt::format("{}--blend {:g}", base, *coarser.blend), coarser);
    } else {
      coarser.cell->value = s.cell->value * factor;
      runs.emplace_back(fmt::format("{}--cell {}", base, to_string(*coarser.cell)), coarser);
    }
  }
  return runs;
}

[[noreturn]] void refuse_memory(const SurfaceSettings& settings, int levels, std::uint64_t needed,
                                std::uint64_t allowed,
                                const std::function<std::uint64_t(const SurfaceSettings&)>& memory_of) {
  const auto mb = [](std::uint64_t bytes) { return static_cast<double>(bytes) / 1e6; };
  std::string remedy;
  for (const auto& [words, changed] : smaller_runs(settings, levels)) {
    const std::uint64_t bytes = memory_of(changed);
    if (bytes > allowed) continue;
    remedy = fmt::format("; {} would fit ({:.0f} MB)", words, mb(bytes));
    break;
  }
  if (remedy.empty()) remedy = "; give it more, or cut the cloud";
  throw Error(ExitCode::budget, fmt::format("{}: needs about {:.0f} MB of memory, --max-memory allows {:.0f} MB{}",
                                            input_name(settings), mb(needed), mb(allowed), remedy));
}

/// Fills the store. A large input is read once, in a frame chosen by a part of its rows; twice where samples lie
/// outside what these promised.
Ingested read_input(PointSource& source, const SurfaceSettings& settings, const StorePlace& place,
                    const RunContext& run, Stopwatch& watch, Frame& frame) {
  require_samples(source.info());
  std::optional<Ingested> ingested;
  const auto fill = [&](const Survey& survey) {
    frame = choose_frame(survey, chosen_frame(settings));
    watch.time("store", [&] {
      ingested.emplace(ingest(source, survey, frame, settings.radius_scale, place, run, settings.clean.pick));
    });
  };
  std::optional<Survey> survey;
  watch.time("survey", [&] { survey = survey_part(source, settings.clean.pick); });
  if (survey) {
    fill(*survey);
    if (ingested->complete) {
      judge(ingested->census, source.info(), settings.bad_samples, run);
      return std::move(*ingested);
    }
    ingested.reset();
  }
  watch.time("survey", [&] { survey = survey_input(source, settings.bad_samples, run, settings.clean.pick); });
  fill(*survey);
  return std::move(*ingested);
}

/// How long the whole run will take, judging by how fast this machine has read the input.
void expect_time(const SurfaceSettings& settings, const PointSourceInfo& source, Resolved& resolved,
                 const Stopwatch& watch, double elapsed) {
  SurfacePlan& plan = resolved.plan;
  plan.threads = tbb::this_task_arena::max_concurrency();
  const double whole = expected_cpu_seconds(settings, resolved, source.attributes.size());
  const double reading = kReferenceRead * static_cast<double>(plan.samples);
  double slowness = 1;
  constexpr std::uint64_t kEnough = 1'000'000;  // fewer are read too fast to tell
  for (const StageTime& s : watch.stages()) {
    // Formats that cost more to read say little of the rest.
    if (s.stage == "store" && source.random_access && plan.samples >= kEnough) {
      // Half of reading is the system's copying, which other programs disturb more than computing.
      slowness = std::clamp(std::sqrt(s.cpu / reading), 0.7, 1.5);
    }
  }
  constexpr double kEfficiency = 0.92;  // of each thread beyond the first
  plan.seconds = elapsed + slowness * (whole - reading) / (1 + kEfficiency * (plan.threads - 1));
}

void refuse_two_alike(const SurfaceSettings& settings, const PointSourceInfo& info) {
  for (const AttributeSpec& a : info.attributes) {
    if ((settings.vertex_levels && a.name == "level") || (settings.vertex_curvature && a.name == "curvature")) {
      throw Error(ExitCode::usage, fmt::format("{}: the points have an attribute called {} already; leave out --{}",
                                               input_name(settings), a.name, a.name));
    }
  }
}

/// What is to be left out before anything is measured.
void clean_store_of(Ingested& in, const SurfaceSettings& settings, double step, const std::string& tmp,
                    const RunContext& run, Stopwatch& watch, std::uint64_t rows, SurfaceStats& stats) {
  stats.cleaned.clipped = in.census.clipped;
  stats.cleaned.skipped = in.census.skipped;
  if (settings.clean.looks_around()) {
    watch.time("clean",
               [&] { clean_ingested(in, settings.clean, step, input_name(settings), tmp, stats.cleaned, run); });
  }
  if (const std::string said = describe(stats.cleaned); !said.empty())
    run.info(fmt::format("{} of {} samples left: {}", in.store.total(), rows, said));
}

}  // namespace

/// Next to the output unless told otherwise; the system's temporary folder for standard output, pipes and devices.
std::string temporary_directory(const SurfaceSettings& settings, const RunContext& run) {
  if (!run.tmp_dir.empty()) return run.tmp_dir;
  std::error_code ignored;
  const auto kind = std::filesystem::status(settings.output, ignored).type();
  const bool beside = kind == std::filesystem::file_type::regular || kind == std::filesystem::file_type::not_found;
  if (settings.output.empty() || settings.output == "-" || !beside) return system_tmp_dir();
  const std::string parent = std::filesystem::path(settings.output).parent_path().string();
  return parent.empty() ? "." : parent;
}

std::vector<std::string> input_names(const SurfaceSettings& settings) {
  std::vector<std::string> names{settings.input};
  names.insert(names.end(), settings.more_inputs.begin(), settings.more_inputs.end());
  return names;
}

std::unique_ptr<PointSource> open_inputs(const SurfaceSettings& settings, const std::string& tmp_dir,
                                         const RunContext& run) {
  std::unique_ptr<PointSource> source = open_points(input_names(settings), {tmp_dir, settings.columns});
  const PointSourceInfo& info = source->info();
  for (const std::string& remark : info.remarks) run.info(remark);
  if (info.geographic) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: x and y are degrees of longitude and latitude, in which no distance can be measured; "
                            "project them to metres first, for example to the UTM zone: pdal translate IN.las OUT.las "
                            "reprojection --filters.reprojection.out_srs=EPSG:326ZONE",
                            info.path));
  }
  return source;
}

/// A mesh in the place of its points would cost the user the scan.
void require_two_files(const SurfaceSettings& settings) {
  std::error_code ignored;
  const bool kept = settings.more_inputs.empty() && is_kept_input(settings.input);
  const std::vector<PointInput> inputs = kept ? std::vector<PointInput>{} : expand_inputs(input_names(settings));
  const auto is_input = [&](const std::string& name) {
    return std::filesystem::is_regular_file(name, ignored) &&
           std::any_of(inputs.begin(), inputs.end(),
                       [&](const PointInput& input) { return std::filesystem::equivalent(input.path, name, ignored); });
  };
  for (const std::string& grids : {settings.volume.path, settings.volume.points}) {
    if (grids.empty()) continue;
    if (grids == settings.output || is_input(grids))
      throw Error(ExitCode::usage, fmt::format("{}: is named twice; give the grids a file of their own", grids));
  }
  if (settings.output == "-" || settings.output.empty()) return;
  if (is_input(settings.output)) {
    throw Error(ExitCode::usage,
                fmt::format("{}: is input and output; give the mesh another name with --output", settings.output));
  }
}

/// Volume tools like a lattice aligned with the input's axes.
FrameMode chosen_frame(const SurfaceSettings& settings) {
  return settings.frame.value_or(settings.volume.wanted() ? FrameMode::axis : FrameMode::pca);
}

SweepInput read_surface_input(const SurfaceSettings& settings, const std::string& directory, bool keep,
                              const RunContext& run, Stopwatch& watch, SurfaceStats& stats) {
  const bool kept = settings.more_inputs.empty() && is_kept_input(settings.input);
  if (kept && !keep) return open_kept_input(settings.input, settings);
  const std::string scratch = keep ? temporary_directory(settings, run) : directory;
  std::unique_ptr<PointSource> source = open_inputs(settings, scratch, run);
  if (settings.normals != NormalsChoice::file)
    watch.time("normals", [&] { source = choose_normals(std::move(source), settings, stats.normals, scratch, run); });
  Frame frame;
  Ingested ingested = read_input(*source, settings, {directory, keep}, run, watch, frame);
  clean_store_of(ingested, settings, frame.step, scratch, run, watch, source->info().count, stats);
  return {source->info(), frame, std::move(ingested)};
}

Resolved plan_surface(const SurfaceSettings& settings, const SweepInput& input, const RunContext& run, Stopwatch& watch,
                      double elapsed, SurfaceStats& stats) {
  const PointSourceInfo& info = input.info;
  const Census& census = input.ingested.census;
  RadiusSurvey radii;
  const auto plan_for = [&](const SurfaceSettings& s) {
    Resolved r = resolve_plan(s, input.frame, input.ingested.store, input.ingested.extent, radii, info.has_radius,
                              info.attributes.size());
    r.plan.memory_bytes += table_bytes(r.lattice, input.ingested);
    return r;
  };
  Resolved resolved;
  watch.time("plan", [&] {
    radii = input.radii ? *input.radii : survey_radii(input.ingested.store, kSurveySamples, settings.density);
    resolved = plan_for(settings);
  });
  expect_time(settings, info, resolved, watch, elapsed);
  stats.plan = resolved.plan;
  stats.samples_read = info.count;
  stats.replaced_attributes = census.unusable_attributes;
  for (int k = 1; k < kDefects; ++k) {
    if (census.rejected[k] > 0) {
      stats.rejected.push_back({describe(static_cast<Defect>(k)), census.rejected[k], census.first_row[k]});
    }
  }
  refuse_two_alike(settings, info);
  run.info(describe(resolved.plan));
  if (const std::string choice = describe_choice(settings, resolved.plan); !choice.empty()) run.info(choice);
  constexpr std::uint64_t kLargestTables = std::uint64_t{1} << 30;  // a scan of 380 million samples needs a few MB
  if (is_out_of_reach(resolved.plan, resolved.support.blend) ||
      table_bytes(resolved.lattice, input.ingested) > kLargestTables) {
    throw Error(ExitCode::empty,
                fmt::format("{}: some of the {} samples lie so far away from the others ({:.3g}, r {:.3g}) that the "
                            "lattice cannot hold both; remove them",
                            input_name(settings), resolved.plan.samples,
                            *std::max_element(resolved.plan.extent.begin(), resolved.plan.extent.end()),
                            resolved.plan.radius_median));
  }
  if (run.max_memory > 0 && resolved.plan.memory_bytes > run.max_memory) {
    SurfaceSettings chosen = settings;
    chosen.blend = resolved.support.blend;
    chosen.cell = resolved.support.cell;
    chosen.refit = resolved.support.refit;
    refuse_memory(chosen, resolved.plan.levels, resolved.plan.memory_bytes, run.max_memory,
                  [&](const SurfaceSettings& s) { return plan_for(s).plan.memory_bytes; });
  }
  stats.disk_bytes = input.ingested.store.disk_bytes();
  return resolved;
}

MeshSinkSettings mesh_layout(const SurfaceSettings& settings, const SweepInput& input, const Resolved& resolved) {
  MeshSinkSettings out;
  out.attributes = input.info.attributes;
  if (settings.vertex_levels) out.attributes.push_back({"level", ScalarType::uint8});
  if (settings.vertex_curvature) out.attributes.push_back({"curvature", ScalarType::float32});
  out.double_positions = needs_double(input.ingested.census, resolved.plan.finest_cell);
  return out;
}

void sweep(const SurfaceSettings& settings, SweepInput& input, const Resolved& resolved, const SlabSpan& span,
           SlabSink& sink, SurfaceVolume* volume, const RunContext& run, Stopwatch& watch, SurfaceStats& stats) {
  const PointSourceInfo& info = input.info;
  SampleFeed feed(input.ingested.store, resolved.lattice, resolved.feed, resolved.radii, info.has_radius);
  std::optional<RefitNormals> refit;
  if (resolved.refit.support > 0) {
    refit.emplace(resolved.refit, resolved.lattice, select_kernel());
    feed.filter_normals(*refit);
  }
  Pipeline pipeline(settings, resolved, input.frame, input.ingested.extent, feed, info.attributes.size(), sink, span,
                    volume);
  pipeline.run(run, watch);
  pipeline.report(stats);
  warn_of_contradictions(stats, input_name(settings), run);
  if (feed.counts().undersampled > 0) {
    stats.rejected.push_back({"radius above --max-radius", feed.counts().undersampled, std::nullopt});
    run.info(fmt::format("{} of {} samples discarded as undersampled: radius above --max-radius",
                         feed.counts().undersampled, info.count));
  }
}

void finish_stats(const Stopwatch& watch, const Stopwatch::Moment& began, SurfaceStats& stats) {
  stats.stages = watch.stages();
  const Stopwatch::Moment ended = Stopwatch::now();
  stats.wall = ended.wall - began.wall;
  stats.cpu = ended.cpu - began.cpu;
  stats.peak_memory = peak_memory();
}

void no_surface(const std::string& input, std::uint64_t samples) {
  throw Error(ExitCode::empty,
              fmt::format("{}: no surface came out of {} samples; they lie too far apart for their radii, or on no "
                          "surface at all (try --blend or --particlescale above 1)",
                          input, samples));
}

void run_in_arena(const RunContext& run, const std::function<void()>& work) {
  const int threads = run.threads > 0 ? run.threads : tbb::this_task_arena::max_concurrency();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  tbb::task_arena arena(threads);
  arena.execute(work);
}

namespace {

void report_pruning(const PruneCounts& counts, const std::string& name, SurfaceStats& stats, const RunContext& run) {
  stats.pruned = counts;
  if (counts.kept == 0 && counts.removed > 0) {
    throw Error(ExitCode::empty, fmt::format("{}: all {} connected parts of the mesh are too small for --prune or "
                                             "--prune-size",
                                             name, counts.removed));
  }
  run.info(fmt::format("{} connected parts, {} small ones left out with {} triangles", counts.kept, counts.removed,
                       counts.removed_triangles));
}

/// On their way to a mesh file, small parts are left out.
class PrunedSlabs final : public SlabSink {
 public:
  explicit PrunedSlabs(Pruner& pruner) : pruner_(pruner) {}
  void write(const FinalSlab& slab, const VertexBatch& vertices) override { pruner_.add(vertices, slab.triangles); }

 private:
  Pruner& pruner_;
};

/// Everything that comes out, from here on, is less the shift.
void shift_output(SweepInput& input, const SurfaceSettings& settings, SurfaceStats& stats, const RunContext& run) {
  stats.shift = local_shift(input.ingested.census);
  input.frame = shifted(input.frame, stats.shift);
  const Eigen::Vector3d by(stats.shift[0], stats.shift[1], stats.shift[2]);
  input.ingested.census.low -= by;
  input.ingested.census.high -= by;
  if (!settings.dry_run) run.info(fmt::format("coordinates are written less {}", shift_text(stats.shift)));
}

SurfaceStats reconstruct(const SurfaceSettings& settings, const RunContext& run) {
  SurfaceStats stats;
  Stopwatch watch;
  const Stopwatch::Moment began = Stopwatch::now();
  const std::string tmp = temporary_directory(settings, run);
  MeshSinkSettings out;
  out.path = settings.output;
  out.tmp_dir = tmp;
  // An output that cannot be written is better known now than after the input has been read.
  if (!settings.dry_run) {
    const MeshSink trial(out);
  }

  SweepInput input = read_surface_input(settings, tmp, /*keep=*/false, run, watch, stats);
  if (settings.local) shift_output(input, settings, stats, run);
  const Resolved resolved = plan_surface(settings, input, run, watch, Stopwatch::now().wall - began.wall, stats);
  if (!settings.dry_run) {
    out = mesh_layout(settings, input, resolved);
    out.path = settings.output;
    out.tmp_dir = tmp;
    if (settings.local) out.comments.push_back("shift " + shift_text(stats.shift));
    MeshSink sink(out);
    std::optional<SurfaceVolume> volume;
    VolumeExport grids = settings.volume;
    if (settings.local) grids.shift = stats.shift;
    if (grids.wanted()) {
      volume.emplace(grids, input.frame, resolved.lattice, resolved.main_level, input.info.attributes, tmp);
    }
    const PruneRule rule{settings.prune_triangles,
                         resolve(settings.prune_size, resolved.plan.radius_median, resolved.support.blend)};
    const bool prunes = rule.triangles > 0 || rule.size > 0;
    MeshFileSlabs whole(sink);
    ClosingSlabs closing(hole_settings(settings, resolved.support), out.attributes.size(), whole);
    Pruner pruner(rule, tmp, closing);
    PrunedSlabs pruned(pruner);
    sweep(settings, input, resolved, all_slabs(resolved.lattice, input.ingested.extent),
          prunes ? static_cast<SlabSink&>(pruned) : closing, volume ? &*volume : nullptr, run, watch, stats);
    if (prunes) {
      watch.time("cluster and write", [&] { pruner.finish(); });
      report_pruning(pruner.counts(), input_name(settings), stats, run);
    }
    watch.time("holes", [&] { stats.holes = close_holes(closing, sink); });
    if (sink.triangles() == 0) no_surface(input_name(settings), resolved.plan.samples);
    if (volume) {
      watch.time("volume", [&] { volume->finish(/*open=*/stats.rejected_loops > 0); });
      volume->commit();
      stats.volume = volume->stats();
    }
    watch.time("commit", [&] { sink.commit(); });
    stats.vertices = sink.vertices();
    stats.triangles = sink.triangles();
  }
  finish_stats(watch, began, stats);
  return stats;
}

}  // namespace

SurfaceStats reconstruct_surface(const SurfaceSettings& settings, const RunContext& run) {
  check_settings(settings);
  require_two_files(settings);
  SurfaceStats stats;
  run_in_arena(run, [&] { stats = reconstruct(settings, run); });
  return stats;
}

}  // namespace lamina
