#include "samples/cleaning.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <mutex>
#include <optional>
#include <utility>

#include "base/descriptor.h"
#include "base/hashing.h"
#include "base/run.h"
#include "edit/rows.h"
#include "lamina/clean.h"
#include "lamina/error.h"
#include "store/ingest.h"

namespace lamina {
namespace {

constexpr std::size_t kFewest = 1 << 10;

std::int64_t cell_along(std::int64_t a, std::int64_t b) {
  return a / b - static_cast<std::int64_t>(a % b != 0 && a < 0);
}

}  // namespace

Thinner::Thinner(double distance)
    : distance_(std::min(distance, 0x1p31)),
      squared_(distance_ * distance_),
      cell_(std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(2 * distance_)))),
      heads_(kFewest, kNone) {}

std::size_t Thinner::place(std::int64_t x, std::int64_t y, std::int64_t z) const {
  return cell_hash(x, y, z) & (heads_.size() - 1);
}

std::size_t Thinner::home(const Kept& k) const {
  return place(cell_along(k.x, cell_), cell_along(k.y, cell_), cell_along(k.z, cell_));
}

bool Thinner::is_near_kept(const Kept& s) const {
  const auto within = static_cast<std::int64_t>(distance_);
  const auto first = [&](std::int64_t v) { return cell_along(v - within, cell_); };
  const auto last = [&](std::int64_t v) { return cell_along(v + within, cell_); };
  for (std::int64_t z = first(s.z); z <= last(s.z); ++z) {
    for (std::int64_t y = first(s.y); y <= last(s.y); ++y) {
      for (std::int64_t x = first(s.x); x <= last(s.x); ++x) {
        for (std::uint32_t i = heads_[place(x, y, z)]; i != kNone; i = kept_[i].next) {
          const Kept& k = kept_[i];
          const double dx = static_cast<double>(s.x) - k.x;
          const double dy = static_cast<double>(s.y) - k.y;
          const double dz = static_cast<double>(s.z) - k.z;
          const float facing = s.nx * k.nx + s.ny * k.ny + s.nz * k.nz;
          if (dx * dx + dy * dy + dz * dz <= squared_ && facing >= 0) return true;
        }
      }
    }
  }
  return false;
}

void Thinner::rehash(std::size_t least) {
  heads_.assign(std::max(kFewest, std::bit_ceil(2 * least)), kNone);
  for (std::uint32_t i = 0; i < kept_.size(); ++i) {
    std::uint32_t& head = heads_[home(kept_[i])];
    kept_[i].next = head;
    head = i;
  }
}

void Thinner::forget_below(std::int64_t z) {
  kept_.erase(std::remove_if(kept_.begin(), kept_.end(), [&](const Kept& k) { return k.z < z; }), kept_.end());
}

std::uint64_t Thinner::thin(const LocalSamples& samples, std::vector<bool>& keep) {
  if (samples.size() == 0) return 0;
  const std::int64_t low = *std::min_element(samples.z.begin(), samples.z.end());
  forget_below(low - static_cast<std::int64_t>(distance_) - 1);
  rehash(kept_.size() + samples.size());
  std::uint64_t dropped = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!keep[i]) continue;
    Kept s{samples.x[i], samples.y[i], samples.z[i], samples.nx[i], samples.ny[i], samples.nz[i], kNone};
    if (is_near_kept(s)) {
      keep[i] = false;
      ++dropped;
      continue;
    }
    std::uint32_t& head = heads_[home(s)];
    s.next = head;
    head = static_cast<std::uint32_t>(kept_.size());
    kept_.push_back(s);
  }
  return dropped;
}

void require_sane(const CleanSettings& s) {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw Error(ExitCode::usage, what);
  };
  if (s.pick.clip) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double low = s.pick.clip->low[k];
      const double high = s.pick.clip->high[k];
      if (!std::isfinite(low) || !std::isfinite(high) || low > high)
        throw Error(ExitCode::usage, fmt::format("--clip: the box ends at {} = {} before it begins at {}; the lower "
                                                 "corner comes first",
                                                 "xyz"[k], high, low));
    }
  }
  require(s.pick.every >= 1, "--every must be 1 or more");
  require(!s.merge || (*s.merge >= 0 && std::isfinite(*s.merge)), "--merge must be 0 (equal positions) or a length");
  require(s.sigma >= 0 && std::isfinite(s.sigma), "--outliers must be 0 (none) or a positive number of deviations");
  require(s.neighbours >= 1 && s.neighbours <= 256, "--neighbours must be in 1..256");
  require(s.spacing >= 0 && std::isfinite(s.spacing), "--spacing must be 0 (none) or a length");
}

std::string describe(const CleanCounts& c) {
  std::string text;
  const auto add = [&](std::uint64_t count, const std::string& what) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, what);
  };
  add(c.clipped, "outside the box");
  add(c.skipped, "skipped");
  add(c.merged, "duplicates merged");
  add(c.outliers, fmt::format("outliers (mean distance above {:.4g})", c.outlier_distance));
  add(c.lonely, "strays far from others");
  add(c.off_surface, "strays on no surface");
  add(c.thinned, "thinned out");
  return text;
}

namespace {

/// Least distance between samples: Thinner over the whole store. Returns how many it has dropped.
std::uint64_t thin_store(const SlabStore& store, double distance, KeepMasks& masks, const RunContext& run) {
  Thinner thinner(distance);
  LocalSamples samples;
  std::uint64_t dropped = 0;
  for (std::size_t b = 0; b < store.buckets(); ++b) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    if (store.count(b) == 0) continue;
    if (b + 1 < store.buckets()) store.will_read(b + 1);
    store.read(b, samples);
    dropped += thinner.thin(samples, masks[b]);
  }
  return dropped;
}

/// Whether more than one sample in a hundred lies at the place of another: what counts samples, as radii do, takes them
/// for twice as dense. Looks at some buckets.
bool has_duplicates(const SlabStore& store) {
  constexpr std::size_t kLooks = 8;
  constexpr std::uint64_t kMostInLook = 1 << 14;
  constexpr std::uint64_t kMostOfHundred = 1;
  std::uint64_t looked_at = 0;
  std::uint64_t duplicates = 0;
  LocalSamples samples;
  std::vector<std::uint64_t> places;
  std::uint64_t passed = 0;
  std::size_t looks = 0;
  for (std::size_t b = 0; b < store.buckets() && looks < kLooks; ++b) {
    passed += store.count(b);
    if (store.count(b) == 0 || passed * 2 * kLooks < store.total() * (2 * looks + 1)) continue;
    ++looks;
    store.read(b, samples);
    // Of many, by place: all that lie there or none.
    const std::uint64_t every = store.count(b) / kMostInLook + 1;
    places.clear();
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const std::uint64_t place = cell_hash(samples.x[i], samples.y[i], samples.z[i]);
      if (scrambled(place) % every == 0) places.push_back(place);
    }
    std::sort(places.begin(), places.end());
    looked_at += places.size();
    duplicates += static_cast<std::uint64_t>(std::distance(std::unique(places.begin(), places.end()), places.end()));
  }
  return duplicates * 100 > kMostOfHundred * looked_at;
}

/// Notes the samples whose masks a step has cleared.
class Noted {
 public:
  Noted(const KeepMasks& masks, bool wanted) : masks_(masks), wanted_(wanted) {
    if (!wanted) return;
    reasons_.resize(masks.size());
    before_ = masks;
  }
  void step(Reason reason) {
    if (!wanted_) return;
    for (std::size_t b = 0; b < masks_.size(); ++b) {
      if (masks_[b] == before_[b]) continue;
      reasons_[b].resize(masks_[b].size(), 0);
      for (std::size_t i = 0; i < masks_[b].size(); ++i) {
        if (before_[b][i] && !masks_[b][i] && reasons_[b][i] == 0) reasons_[b][i] = reason;
      }
    }
    before_ = masks_;
  }
  [[nodiscard]] Reasons* reasons() { return wanted_ ? &reasons_ : nullptr; }

 private:
  const KeepMasks& masks_;
  bool wanted_;
  KeepMasks before_;
  Reasons reasons_;
};

Extent extent_of(const SlabStore& store) {
  constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();
  constexpr std::int32_t kMin = std::numeric_limits<std::int32_t>::min();
  const auto both = [](Extent a, const Extent& b) {
    widen(a, b);
    return a;
  };
  const auto add = [&](const tbb::blocked_range<std::size_t>& buckets, Extent e) {
    LocalSamples samples;
    for (std::size_t b = buckets.begin(); b < buckets.end(); ++b) {
      if (store.count(b) == 0) continue;
      store.read(b, samples);
      const auto [x_min, x_max] = std::minmax_element(samples.x.begin(), samples.x.end());
      const auto [y_min, y_max] = std::minmax_element(samples.y.begin(), samples.y.end());
      widen(e, {{*x_min, *x_max, *y_min, *y_max}, store.z_lower(b), store.z_upper(b)});
    }
    return e;
  };
  return tbb::parallel_reduce(tbb::blocked_range<std::size_t>(0, store.buckets()),
                              Extent{{kMax, kMin, kMax, kMin}, kMax, kMin}, add, both);
}

}  // namespace

KeepMasks choose_samples(const SlabStore& store, const Cleaning& cleaning, CleanCounts& counts, const RunContext& run) {
  const CleanSettings& settings = cleaning.settings;
  KeepMasks masks(store.buckets());
  for (std::size_t b = 0; b < masks.size(); ++b) masks[b].assign(store.count(b), true);
  Noted noted(masks, static_cast<bool>(cleaning.rejected));
  std::optional<double> merge = settings.merge;
  if (!merge && settings.strays && has_duplicates(store)) merge = 0;
  if (merge) counts.merged = thin_store(store, *merge / cleaning.step, masks, run);
  noted.step(kReasonMerged);
  if (settings.sigma > 0) {
    const Outliers outliers =
        drop_outliers(store, {settings.neighbours, settings.sigma}, cleaning.directory, masks, run);
    counts.outliers = outliers.count;
    counts.outlier_distance = outliers.limit * cleaning.step;
  }
  noted.step(kReasonOutlier);
  if (settings.strays) {
    const StrayCounts strays = drop_strays(store, masks, cleaning.normals, run, noted.reasons());
    counts.lonely = strays.lonely;
    counts.off_surface = strays.off_surface;
  }
  noted.step(kReasonOffSurface);
  if (settings.spacing > 0) counts.thinned = thin_store(store, settings.spacing / cleaning.step, masks, run);
  noted.step(kReasonThinned);
  if (cleaning.rejected) cleaning.rejected(*noted.reasons());
  return masks;
}

void clean_ingested(Ingested& in, const Cleaning& cleaning, const std::string& name, CleanCounts& counts,
                    const RunContext& run) {
  in.store.keep_only(choose_samples(in.store, cleaning, counts, run));
  if (in.store.total() == 0)
    throw Error(ExitCode::empty, fmt::format("{}: cleaning has left no samples ({})", name, describe(counts)));
  // Far outliers would have the sweep go through their emptiness.
  if (counts.merged + counts.outliers + counts.lonely + counts.off_surface + counts.thinned > 0)
    in.extent = extent_of(in.store);
}

std::string cleaning_words(const CleanSettings& settings) {
  // Every setting by name: one that is added must be dealt with here, or this does not compile.
  const auto& [pick, merge, sigma, neighbours, strays, spacing] = settings;
  const auto& [clip, every] = pick;
  std::string words;
  const auto add = [&](bool given, const std::string& text) {
    if (given) words += (words.empty() ? "" : " ") + text;
  };
  if (clip) {
    const auto& [low, high] = *clip;
    add(true, fmt::format("clip {},{},{},{},{},{}", low[0], low[1], low[2], high[0], high[1], high[2]));
  }
  add(every > 1, fmt::format("every {}", every));
  add(merge.has_value(), fmt::format("merge {}", merge.value_or(0)));
  add(sigma > 0, fmt::format("outliers {} neighbours {}", sigma, neighbours));
  add(strays, "strays");
  add(spacing > 0, fmt::format("spacing {}", spacing));
  return words;
}

namespace {

/// Which rows do not stay, found by the steps that look around.
std::vector<bool> rows_to_drop(PointSource& source, const CleanSettings& settings, BadSamples bad, CleanCounts& counts,
                               const RunContext& run) {
  const std::string directory = run.tmp_dir.empty() ? system_tmp_dir() : run.tmp_dir;
  // Measured: the store's buffers, the samples looked at together and the program; masks and the store's index.
  constexpr std::uint64_t kProgram = std::uint64_t{92} << 20;
  const std::uint64_t masks = source.info().count + source.info().count / 4;
  require_memory(run, kProgram + masks, source.info().path, "cleaning");
  RunContext silent = run;  // what is left out is told by whoever writes the rows
  silent.log = nullptr;
  RowIdSource rows(source);
  const Survey survey = survey_input(rows, bad, silent, settings.pick);
  const Frame frame = choose_frame(survey, FrameMode::pca);
  const Ingested in = ingest(rows, survey, frame, directory, run, {1, settings.pick});
  const SampleNormals normals = source.info().has_normals ? SampleNormals::given : SampleNormals::none;
  const KeepMasks keep = choose_samples(in.store, {settings, frame.step, directory, normals}, counts, run);
  std::vector<bool> drop(source.info().count, false);
  LocalSamples samples;
  for (std::size_t b = 0; b < keep.size(); ++b) {
    if (in.store.count(b) == 0) continue;
    in.store.read(b, samples);
    for (std::size_t i = 0; i < keep[b].size(); ++i) {
      if (!keep[b][i]) drop[row_of(samples, i)] = true;
    }
  }
  return drop;
}

}  // namespace

CleanReport clean_points(PointSource& source, PointsWriter& writer, const CleanSettings& settings, BadSamples bad,
                         const RunContext& run) {
  require_sane(settings);
  CleanReport report;
  std::vector<bool> drop;
  if (settings.looks_around()) {
    with_threads(run.threads, [&] { drop = rows_to_drop(source, settings, bad, report.counts, run); });
  }
  std::mutex mutex;
  CleanCounts picked;
  const auto work = [&](SampleBatch& batch) {
    CleanCounts counts;
    std::vector<std::uint8_t> stays(batch.size());
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const std::uint64_t row = batch.first + i;
      const Pick pick = judge(settings.pick, batch, i, row);
      counts.skipped += pick == Pick::skipped ? 1 : 0;
      counts.clipped += pick == Pick::clipped ? 1 : 0;
      stays[i] = pick == Pick::taken && (drop.empty() || !drop[row]) ? 1 : 0;
    }
    const EditReport rows = clean_rows(batch, std::move(stays));
    if (rows.bad_rows > 0 && bad == BadSamples::refuse) refuse_bad_row(rows, source.info().path);
    const std::lock_guard lock(mutex);
    add(report.rows, rows);
    picked.clipped += counts.clipped;
    picked.skipped += counts.skipped;
  };
  edit::for_each_batch(source, "write", run, work, [&](SampleBatch& batch) { writer.append(batch); });
  report.counts.clipped = picked.clipped;
  report.counts.skipped = picked.skipped;
  report.rows.written = writer.rows();
  return report;
}

}  // namespace lamina
