#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/output_file.h"
#include "chunks/part_file.h"
#include "lamina/error.h"
#include "lamina/ranks.h"
#include "ranks/together.h"
#include "reconstruct/job.h"
#include "reconstruct/pipeline.h"
#include "reconstruct/stored_cloud.h"

namespace lamina::ranks {
namespace {

/// The undersampled are found by each rank alone; slabs beside a rank's own are seen by two.
constexpr const char* kUndersampled = "radius above --max-radius";

std::uint64_t take_undersampled(SurfaceStats& stats) {
  const auto found = std::find_if(stats.rejected.begin(), stats.rejected.end(),
                                  [](const Rejected& r) { return r.reason == kUndersampled; });
  if (found == stats.rejected.end()) return 0;
  const std::uint64_t count = found->count;
  stats.rejected.erase(found);
  return count;
}

/// The counts of all ranks as those of one run.
void sum_stats(Ranks& ranks, SurfaceStats& stats) {
  std::uint64_t undersampled = take_undersampled(stats);
  std::array<std::int64_t, 2> most{static_cast<std::int64_t>(stats.peak_memory),
                                   static_cast<std::int64_t>(stats.leaf_cells.size())};
  ranks.most(most);
  stats.peak_memory = static_cast<std::uint64_t>(most[0]);
  stats.leaf_cells.resize(static_cast<std::size_t>(most[1]), 0);
  constexpr double kMicro = 1e-6;
  auto cpu = static_cast<std::uint64_t>(std::llround(stats.cpu / kMicro));
  ClusterCounts& c = stats.clusters;
  std::vector<std::uint64_t*> counts{&undersampled,        &cpu,
                                     &stats.corners,       &stats.corner_sums,
                                     &stats.corners_seen,  &stats.corners_trusted,
                                     &stats.corners_torn,  &stats.isovertices,
                                     &stats.isotriangles,  &stats.rejected_loops,
                                     &stats.general_cells, &stats.crossing_cells,
                                     &stats.disk_bytes,    &c.corners,
                                     &c.collapsed,         &c.patches,
                                     &c.kept_isovertices,  &c.resolved};
  for (std::uint64_t& cells : stats.leaf_cells) counts.push_back(&cells);
  std::vector<std::uint64_t> values;
  values.reserve(counts.size());
  for (const std::uint64_t* count : counts) values.push_back(*count);
  ranks.sum(values);
  for (std::size_t i = 0; i < counts.size(); ++i) *counts[i] = values[i];
  stats.cpu = static_cast<double>(cpu) * kMicro;
  if (undersampled > 0) stats.rejected.push_back({kUndersampled, undersampled, std::nullopt});
}

/// What the whole job needs, known before anything is read. On rank 0 also that the output can be written.
void check_job(const SurfaceSettings& settings, const RunContext& run, bool first) {
  check_settings(settings);
  require_mesh_alone(settings, "mpirun");
  if (!names_kept_input(settings) && (settings.clean.looks_around() || !settings.clean.pick.takes_all())) {
    throw Error(
        ExitCode::usage,
        "ranks that share out an input's rows cannot clean them: clean the points before, with 'lamina clean', "
        "or put them into a store with the same options, 'lamina sort IN... --store DIR', and give mpirun that");
  }
  const std::vector<std::string> outputs = output_names(settings);
  if (std::find(outputs.begin(), outputs.end(), "-") != outputs.end())
    throw Error(ExitCode::usage, "several ranks write one file together: give --output a name");
  if (!first) return;
  require_two_files(settings);
  for (const std::string& output : outputs) {
    const OutputFile trial(output, run.tmp_dir);
    if (trial.streams()) {
      throw Error(ExitCode::usage,
                  fmt::format("{}: is no regular file; several ranks write one file together", output));
    }
  }
}

/// The buckets that a sweep through the span reads.
BucketSpan buckets_for(const ReconstructionPlan& plan, const SlabStore& store, const SlabSpan& span) {
  const ZRead z = z_read(plan, span);
  const double filter = plan.refit.support > 0 ? RefitNormals(plan.refit, plan.lattice, select_kernel()).halo() : 0;
  return buckets_read(store, feed_halo(plan.feed, plan.lattice, plan.radii, plan.given_radii, filter), z.from, z.to);
}

/// A run that ends when another rank's has, and speaks on rank 0 alone; warnings of the others are kept for it.
class RankRun {
 public:
  RankRun(Ranks& ranks, const RunContext& given) : ranks_(ranks), given_(given), own_(given) {
    own_.cancel = &cancelled_;
    own_.progress = [this](const Progress& p) {
      if (given_.cancelled() || ranks_.failed_elsewhere()) cancelled_ = true;
      if (ranks_.first() && given_.progress && (p.samples_total > 0 || p.slabs_total > 0)) show(p);
    };
    own_.log = [this](LogLevel level, std::string_view text) {
      if (ranks_.first()) {
        if (given_.log) given_.log(level, text);
      } else if (keeping_ && level == LogLevel::warning) {
        warnings_.emplace_back(text);
      }
    };
  }
  [[nodiscard]] const RunContext& context() const { return own_; }
  /// From here on ranks have warnings of their own; before, all have the same.
  void keep_warnings() { keeping_ = true; }
  /// Rank 0 says what the others have kept.
  void pass_warnings_on() {
    Packer words;
    words.put(warnings_.size());
    for (const std::string& w : warnings_) words.put(w);
    const std::vector<Bytes> all = ranks_.gather(words.take());
    for (std::size_t r = 1; r < all.size(); ++r) {
      Unpacker in(all[r]);
      for (auto left = in.get<std::size_t>(); left > 0; --left)
        given_.warn(fmt::format("{} (rank {})", in.get_text(), r));
    }
  }

 private:
  /// Samples of a sweep are those of all ranks: its slabs say more.
  void show(Progress p) const {
    if (p.slabs_total > 0) p.samples_done = p.samples_total = 0;
    given_.progress(p);
  }
  Ranks& ranks_;
  const RunContext& given_;
  RunContext own_;
  std::atomic<bool> cancelled_ = false;
  bool keeping_ = false;
  std::vector<std::string> warnings_;
};

class RanksJob {
 public:
  RanksJob(Ranks& ranks, const SurfaceSettings& settings, const RunContext& run)
      : ranks_(ranks), settings_(settings), rank_run_(ranks, run), job_(rank_run_.context()) {}

  RanksStats finish() {
    ranks_.together([&] { check_job(settings_, job_.run, ranks_.first()); });
    directory_ = temporary_directory(settings_, job_.run);
    StoredCloud cloud = read();
    std::optional<ReconstructionPlan> made;
    ranks_.together([&] { made.emplace(plan_surface(settings_, cloud, job_)); });
    const ReconstructionPlan& plan = *made;
    const SlabSpan span = share_out(cloud, plan);
    std::optional<RankSlabs> part;
    rank_run_.keep_warnings();
    const double before = Stopwatch::now().wall;
    ranks_.together([&] {
      part.emplace(span, mesh_layout(plan), directory_);
      if (!span.empty()) sweep(plan, cloud, span, {*part}, job_);
    });
    own_.sweeping = Stopwatch::now().wall - before;
    job_.watch.time("commit", [&] {
      const Place place = write_together(ranks_, plan, *part, output_names(settings_), job_);
      job_.stats.vertices = place.vertices;
      job_.stats.triangles = place.triangles;
      if (plan.simplify.wanted() && ranks_.first()) {
        job_.stats.vertices = job_.stats.simplified.vertices_after;
        job_.stats.triangles = job_.stats.simplified.triangles_after;
      }
    });
    job_.stats.disk_bytes = std::max(job_.stats.disk_bytes, disk_ + part->disk_bytes());
    own_.vertices = part->vertices();
    own_.triangles = part->triangles();
    rank_run_.pass_warnings_on();
    job_.finish();
    return gather_stats();
  }

 private:
  StoredCloud read() {
    if (names_kept_input(settings_)) {
      std::optional<StoredCloud> cloud;
      ranks_.together([&] { cloud.emplace(open_kept_input(settings_.input, settings_)); });
      return std::move(*cloud);
    }
    SharedInput shared = read_together(ranks_, settings_, directory_, job_);
    own_.rows_read = shared.rows;
    job_.watch.time("plan",
                    [&] { shared.cloud.survey = survey_together(ranks_, settings_, shared.cloud.ingested.store); });
    return std::move(shared.cloud);
  }

  /// The rank's slabs; leaves in `cloud` what they take.
  SlabSpan share_out(StoredCloud& cloud, const ReconstructionPlan& plan) {
    SlabStore& store = cloud.ingested.store;
    const std::vector<SlabSpan> spans = cut(plan, store, ranks_.size());
    std::vector<BucketSpan> wanted;
    wanted.reserve(spans.size());
    for (const SlabSpan& span : spans) wanted.push_back(span.empty() ? BucketSpan{} : buckets_for(plan, store, span));
    const auto rank = static_cast<std::size_t>(ranks_.rank());
    const SlabSpan own = spans[rank];
    own_.first_slab = own.begin - plan.slabs.begin;
    own_.slabs = own.size();
    if (!own.empty()) own_.overlap_slabs = plan.stages_of(own).of(Stage::project).size() - own_.slabs;
    own_.samples = samples_in(plan, store, own);
    for (std::size_t b = wanted[rank].begin; b < wanted[rank].end; ++b) own_.samples_held += store.count(b);
    if (!names_kept_input(settings_)) {
      job_.watch.time("share", [&] {
        SlabStore gathered = gather_buckets(ranks_, store, wanted, directory_, job_.run);
        disk_ = gathered.disk_bytes();
        job_.stats.disk_bytes = store.disk_bytes() + disk_;
        store = std::move(gathered);
      });
    }
    return own;
  }

  RanksStats gather_stats() {
    own_.seconds = job_.stats.wall;
    own_.cpu = job_.stats.cpu;
    own_.peak_memory = job_.stats.peak_memory;
    own_.waited = ranks_.traffic().waited;
    own_.sent = ranks_.traffic().sent;
    own_.received = ranks_.traffic().received;
    Packer words;
    words.put(own_);
    RanksStats all;
    for (const Bytes& bytes : ranks_.gather(words.take())) all.ranks.push_back(Unpacker(bytes).get<RankStats>());
    sum_stats(ranks_, job_.stats);
    all.surface = job_.stats;
    return all;
  }

  Ranks& ranks_;
  const SurfaceSettings& settings_;
  RankRun rank_run_;
  Job job_;
  std::string directory_;
  RankStats own_;
  std::uint64_t disk_ = 0;  ///< of the gathered store
};

}  // namespace
}  // namespace lamina::ranks

namespace lamina {
namespace {

std::optional<int> number_in(const char* variable) {
  const char* const text = std::getenv(variable);
  if (text == nullptr) return std::nullopt;
  const std::string_view digits(text);
  int value = 0;
  const auto [end, bad] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (bad != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return value;
}

}  // namespace

Launch launch() {
  // Open MPI's mpirun; MPICH's and Intel's; Slurm's srun, where it speaks PMIx.
  static constexpr std::array<std::pair<const char*, const char*>, 3> kVariables{
      {{"OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"},
       {"PMI_SIZE", "PMI_RANK"},
       {"SLURM_STEP_NUM_TASKS", "PMIX_RANK"}}};
  for (const auto& [size, rank] : kVariables) {
    const std::optional<int> processes = number_in(size), own = number_in(rank);
    if (processes && own && *processes > 1 && *own >= 0 && *own < *processes) return {*own, *processes};
  }
  return {};
}

RanksStats reconstruct_ranks(const SurfaceSettings& settings, const RunContext& run) {
  ranks::Ranks ranks;
  RanksStats stats;
  run_in_arena(run, [&] { stats = ranks::RanksJob(ranks, settings, run).finish(); });
  return stats;
}

}  // namespace lamina
