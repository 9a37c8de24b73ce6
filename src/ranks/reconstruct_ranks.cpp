#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <optional>

#include "base/output_file.h"
#include "chunks/cuts.h"
#include "chunks/job.h"
#include "lamina/error.h"
#include "lamina/ranks.h"
#include "ranks/gather_store.h"
#include "ranks/rank_slabs.h"
#include "ranks/read_together.h"
#include "ranks/sum_stats.h"
#include "ranks/write_together.h"
#include "reconstruct/choose_support.h"
#include "reconstruct/kept_input.h"
#include "reconstruct/pipeline.h"

namespace lamina::ranks {
namespace {

bool is_store(const SurfaceSettings& settings) {
  return settings.more_inputs.empty() && is_kept_input(settings.input);
}

/// What the whole job needs, known before anything is read. On rank 0 also that the output can be written.
void check_job(const SurfaceSettings& settings, const RunContext& run, bool first) {
  check_settings(settings);
  require_mesh_alone(settings, "mpirun");
  if (!is_store(settings) && (settings.clean.looks_around() || !settings.clean.pick.takes_all())) {
    throw Error(
        ExitCode::usage,
        "ranks that share out an input's rows cannot clean them: clean the points before, with 'lamina clean', "
        "or put them into a store with the same options, 'lamina sort IN... --store DIR', and give mpirun that");
  }
  if (settings.output == "-")
    throw Error(ExitCode::usage, "several ranks write one file together: give --output a name");
  if (!first) return;
  require_two_files(settings);
  const OutputFile trial(settings.output, run.tmp_dir);
  if (trial.streams()) {
    throw Error(ExitCode::usage,
                fmt::format("{}: is no regular file; several ranks write one file together", settings.output));
  }
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

class Job {
 public:
  Job(Ranks& ranks, const SurfaceSettings& settings, const RunContext& run)
      : ranks_(ranks), settings_(settings), rank_run_(ranks, run), run_(rank_run_.context()) {}

  RanksStats finish() {
    ranks_.together([&] { check_job(settings_, run_, ranks_.first()); });
    directory_ = temporary_directory(settings_, run_);
    SweepInput input = read();
    Resolved resolved;
    ranks_.together(
        [&] { resolved = plan_surface(settings_, input, run_, watch_, Stopwatch::now().wall - began_.wall, stats_); });
    const SlabSpan span = share_out(input, resolved);
    std::optional<RankSlabs> part;
    rank_run_.keep_warnings();
    const double before = Stopwatch::now().wall;
    ranks_.together([&] {
      part.emplace(span, mesh_layout(settings_, input, resolved), directory_);
      if (!span.empty()) sweep(settings_, input, resolved, span, *part, nullptr, run_, watch_, stats_);
    });
    own_.sweeping = Stopwatch::now().wall - before;
    watch_.time("commit", [&] {
      const Place place = write_together(ranks_, span, *part, settings_.output, settings_.input, resolved.plan.samples,
                                         hole_settings(settings_, resolved.support), stats_.holes, run_);
      stats_.vertices = place.vertices;
      stats_.triangles = place.triangles;
    });
    stats_.disk_bytes = std::max(stats_.disk_bytes, disk_ + part->disk_bytes());
    own_.vertices = part->vertices();
    own_.triangles = part->triangles();
    rank_run_.pass_warnings_on();
    finish_stats(watch_, began_, stats_);
    return gather_stats();
  }

 private:
  SweepInput read() {
    if (is_store(settings_)) {
      std::optional<SweepInput> input;
      ranks_.together([&] { input.emplace(open_kept_input(settings_.input, settings_)); });
      return std::move(*input);
    }
    SharedInput shared = read_together(ranks_, settings_, directory_, run_, watch_);
    own_.rows_read = shared.rows;
    stats_.normals = shared.normals;
    watch_.time("plan", [&] {
      shared.input.radii = survey_together(ranks_, shared.input.ingested.store, kSurveySamples, settings_.density);
    });
    return std::move(shared.input);
  }

  /// The rank's slabs; leaves in `input` what they take.
  SlabSpan share_out(SweepInput& input, const Resolved& resolved) {
    SlabStore& store = input.ingested.store;
    const SlabSpan all = all_slabs(resolved.lattice, input.ingested.extent);
    const std::vector<SlabSpan> spans = cut(store, resolved.lattice, all, ranks_.size());
    std::vector<BucketSpan> wanted;
    for (const SlabSpan& span : spans) {
      const ZRead z = z_read(settings_, resolved, span, all);
      wanted.push_back(span.empty() ? BucketSpan{}
                                    : buckets_read(store, resolved.radii, input.info.has_radius, z.from, z.to,
                                                   filter_reach(resolved)));
    }
    const auto rank = static_cast<std::size_t>(ranks_.rank());
    const SlabSpan own = spans[rank];
    own_.first_slab = own.begin - all.begin;
    own_.slabs = own.end - own.begin;
    if (!own.empty()) {
      const SlabSpan projected = stage_spans(own, all, settings_.diffuse).projected;
      own_.overlap_slabs = projected.end - projected.begin - own_.slabs;
    }
    const std::vector<double> samples = slab_samples(store, resolved.lattice, all);
    double sum = 0;
    for (std::int32_t s = own.begin; s < own.end; ++s) sum += samples[static_cast<std::size_t>(s - all.begin)];
    own_.samples = static_cast<std::uint64_t>(std::llround(sum));
    for (std::size_t b = wanted[rank].begin; b < wanted[rank].end; ++b) own_.samples_held += store.count(b);
    if (!is_store(settings_)) {
      watch_.time("share", [&] {
        SlabStore gathered = gather_buckets(ranks_, store, wanted, directory_, run_);
        disk_ = gathered.disk_bytes();
        stats_.disk_bytes = store.disk_bytes() + disk_;
        store = std::move(gathered);
      });
    }
    return own;
  }

  RanksStats gather_stats() {
    own_.seconds = stats_.wall;
    own_.cpu = stats_.cpu;
    own_.peak_memory = stats_.peak_memory;
    own_.waited = ranks_.traffic().waited;
    own_.sent = ranks_.traffic().sent;
    own_.received = ranks_.traffic().received;
    Packer words;
    words.put(own_);
    RanksStats all;
    for (const Bytes& bytes : ranks_.gather(words.take())) all.ranks.push_back(Unpacker(bytes).get<RankStats>());
    sum_stats(ranks_, stats_);
    all.surface = stats_;
    return all;
  }

  Ranks& ranks_;
  const SurfaceSettings& settings_;
  RankRun rank_run_;
  const RunContext& run_;
  Stopwatch watch_;
  Stopwatch::Moment began_ = Stopwatch::now();
  std::string directory_;
  SurfaceStats stats_;
  RankStats own_;
  std::uint64_t disk_ = 0;  ///< of the gathered store
};

}  // namespace
}  // namespace lamina::ranks

namespace lamina {

RanksStats reconstruct_ranks(const SurfaceSettings& settings, const RunContext& run) {
  ranks::Ranks ranks;
  RanksStats stats;
  run_in_arena(run, [&] { stats = ranks::Job(ranks, settings, run).finish(); });
  return stats;
}

}  // namespace lamina
