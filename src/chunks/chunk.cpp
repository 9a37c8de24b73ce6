#include "chunks/part_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/output_file.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "lamina/run.h"
#include "reconstruct/job.h"
#include "reconstruct/stored_cloud.h"
#include "samples/cleaning.h"

namespace lamina {
namespace {

/// What a slab costs whatever it holds: as much as so many samples.
constexpr double kSlab = 500;
/// Of a slab beside the chunk: it is read, refined and projected, but gives no mesh.
constexpr double kBeside = 0.7;
constexpr std::size_t kBelow = reach_of(Stage::project).below, kAbove = reach_of(Stage::project).above;

class Costs {
 public:
  explicit Costs(const std::vector<double>& cost) : sums_(cost.size() + 1, 0.0) {
    for (std::size_t s = 0; s < cost.size(); ++s) sums_[s + 1] = sums_[s] + cost[s];
  }
  [[nodiscard]] std::size_t slabs() const { return sums_.size() - 1; }
  [[nodiscard]] double whole() const { return sums_.back(); }
  /// Of a chunk of slabs [begin, end).
  [[nodiscard]] double of(std::size_t begin, std::size_t end) const {
    const std::size_t from = begin - std::min(begin, kBelow), to = std::min(end + kAbove, slabs());
    return sums_[end] - sums_[begin] + kBeside * (sums_[begin] - sums_[from] + sums_[to] - sums_[end]);
  }

 private:
  std::vector<double> sums_;
};

/// Ends of chunks that each cost at most `most`, one slab at least; as many as it takes.
std::vector<std::size_t> ends_within(const Costs& costs, double most, std::size_t limit) {
  std::vector<std::size_t> ends;
  for (std::size_t begin = 0; begin < costs.slabs();) {
    if (ends.size() == limit) return {};
    std::size_t end = begin + 1;
    while (end < costs.slabs() && costs.of(begin, end + 1) <= most) ++end;
    ends.push_back(end);
    begin = end;
  }
  return ends;
}

}  // namespace

std::vector<double> slab_samples(const ReconstructionPlan& plan, const SlabStore& store) {
  std::vector<double> samples(static_cast<std::size_t>(plan.slabs.size()), 0.0);
  const double height = plan.lattice.slab_height();
  for (std::size_t b = 0; b < store.buckets(); ++b) {
    if (store.count(b) == 0) continue;
    const double low = store.z_lower(b), high = static_cast<double>(store.z_upper(b)) + 1;
    const double per_step = static_cast<double>(store.count(b)) / (high - low);
    const std::int32_t last = plan.lattice.slab_of(store.z_upper(b));
    for (std::int32_t s = plan.lattice.slab_of(store.z_lower(b)); s <= last; ++s) {
      const double share = std::min(high, (s + 1.0) * height) - std::max(low, s * height);
      samples[static_cast<std::size_t>(s - plan.slabs.begin)] += per_step * share;
    }
  }
  return samples;
}

std::uint64_t samples_in(const ReconstructionPlan& plan, const SlabStore& store, const SlabSpan& span) {
  const std::vector<double> samples = slab_samples(plan, store);
  double sum = 0;
  for (std::int32_t s = span.begin; s < span.end; ++s) sum += samples[static_cast<std::size_t>(s - plan.slabs.begin)];
  return static_cast<std::uint64_t>(std::llround(sum));
}

double chunk_cost(const std::vector<double>& cost, std::size_t begin, std::size_t end) {
  return Costs(cost).of(begin, end);
}

std::vector<SlabSpan> cut(const std::vector<double>& cost, std::int32_t first, int count) {
  const Costs costs(cost);
  const auto limit = static_cast<std::size_t>(count);
  double low = 0, high = costs.whole() * (1 + kBeside);
  std::vector<std::size_t> best = ends_within(costs, high, limit);
  constexpr int kHalvings = 40;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    std::vector<std::size_t> ends = ends_within(costs, middle, limit);
    (ends.empty() ? low : high) = middle;
    if (!ends.empty()) best = std::move(ends);
  }
  best.resize(limit, cost.size());
  std::vector<SlabSpan> spans;
  std::int32_t begin = first;
  for (const std::size_t end : best) {
    spans.push_back({begin, first + static_cast<std::int32_t>(end)});
    begin = spans.back().end;
  }
  return spans;
}

std::vector<SlabSpan> cut(const ReconstructionPlan& plan, const SlabStore& store, int count) {
  std::vector<double> cost = slab_samples(plan, store);
  for (double& c : cost) c += kSlab;
  return cut(cost, plan.slabs.begin, count);
}

std::string mesh_settings(const SurfaceSettings& settings) {
  // Every setting by name: one that is added must be dealt with here, or this does not compile. What follows `chord`
  // does not change the mesh; names of files are not settings of it.
  const auto& [input, more_inputs, open, reading, output, more_outputs, receiver, frame, bad_samples, normals,
               normal_search, align, guess_trade, radius_scale, density, clean, max_radius, blend, refit, steps,
               step_tolerance, fit, diffuse, cell, levels, boundary, cluster, chord, vertex_levels, vertex_curvature,
               vertex_filled, close_holes, watertight, bridge, fill_all, trim, features, prune_triangles, prune_size,
               local, window, dry_run, rejected, simplify, deviation, volume, tiles] = settings;
  // Jobs of several runs refuse these: require_mesh_alone().
  (void)prune_triangles, (void)prune_size, (void)local, (void)tiles, (void)open, (void)receiver, (void)rejected;
  (void)input, (void)more_inputs, (void)output, (void)more_outputs, (void)normals, (void)normal_search,
      (void)guess_trade, (void)window, (void)dry_run;
  (void)simplify;  // is for what joins the parts
  const auto number = [](const std::optional<double>& v) { return v ? fmt::format("{}", *v) : "auto"; };
  const auto word = [](const std::optional<bool>& v) { return v ? (*v ? "yes" : "no") : "auto"; };
  const std::string frame_word = frame             ? fmt::format("{}", static_cast<int>(*frame))
                                 : volume.wanted() ? "grid"
                                                   : "auto";
  return fmt::format(
      "columns {}\nprojected {}\nselect {}\nframe {}\nbad_samples {}\nnormals {}\nalign {}\ncleaning {}\nparticlescale "
      "{}\ndensity "
      "{}\nmax_radius {}\n"
      "blend {}\nrefit {}\nsteps {}\nstep_tolerance {}\nfit {}\ndiffuse {}\ncell {}\nlevels {}\nboundary {}\ncluster "
      "{}\n"
      "chord {}\nlevel {}\ncurvature {}\nfilled {}\nclose_holes {}\nwatertight {}\nbridge {}\nfill_all {}\ntrim "
      "{}\nfeatures {}\n"
      "deviation {}\n",
      reading.columns, reading.project_degrees, to_string(reading.select), frame_word, static_cast<int>(bad_samples),
      normals_words(settings), align, cleaning_words(clean), radius_scale, density, to_string(max_radius),
      number(blend), number(refit), steps, step_tolerance, static_cast<int>(fit), diffuse,
      cell ? to_string(*cell) : "auto", levels, boundary, static_cast<int>(cluster), chord, vertex_levels,
      vertex_curvature, vertex_filled, number(close_holes), word(watertight), word(bridge), fill_all, number(trim),
      word(features), number(deviation));
}

std::uint64_t job_hash(const SurfaceSettings& settings, const std::string& input_id, const ReconstructionPlan& plan) {
  const std::string text =
      fmt::format("{}\n{}\n{}\nlattice {} {} radii {} {}\n", version(), input_id, mesh_settings(settings),
                  plan.lattice.cell, plan.lattice.levels, plan.radii.finest_cell, plan.radii.levels);
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  return hash;
}

void require_mesh_alone(const SurfaceSettings& settings, const std::string& option) {
  if (settings.volume.wanted()) {
    throw Error(ExitCode::usage,
                fmt::format("{} makes the mesh alone: leave --vdb and --vdb-points to a run of their own", option));
  }
  if (!settings.tiles.folder.empty()) {
    throw Error(ExitCode::usage,
                fmt::format("{} makes the mesh alone: leave --tiles away, and make them of it: lamina tiles", option));
  }
  if (settings.prune_triangles.value_or(0) > 0 || settings.prune_size.value > 0 || settings.local)
    throw Error(ExitCode::usage,
                fmt::format("{}: --prune, --prune-size and --local want the mesh from one run", option));
  if (!settings.rejected.empty())
    throw Error(ExitCode::usage, fmt::format("{}: --rejected wants the whole cloud in one run", option));
  if (settings.open || settings.receiver)
    throw Error(ExitCode::usage, fmt::format("{} wants files: what is in memory is gone with the run", option));
  if (settings.dry_run) throw Error(ExitCode::usage, fmt::format("{} and --dry-run contradict each other", option));
}

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
  run_in_arena(job, [&] { stats = run_chunk(settings, chunk, job); });
  return stats;
}

}  // namespace lamina
