#include "samples/cleaning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "lamina/clean.h"
#include "lamina/error.h"
#include "samples/strays.h"
#include "samples/thinner.h"

namespace lamina {

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
  Extent e{{kMax, kMin, kMax, kMin}, kMax, kMin};
  LocalSamples samples;
  for (std::size_t b = 0; b < store.buckets(); ++b) {
    if (store.count(b) == 0) continue;
    store.read(b, samples);
    const auto [x_min, x_max] = std::minmax_element(samples.x.begin(), samples.x.end());
    const auto [y_min, y_max] = std::minmax_element(samples.y.begin(), samples.y.end());
    e.x_min = std::min(e.x_min, *x_min);
    e.x_max = std::max(e.x_max, *x_max);
    e.y_min = std::min(e.y_min, *y_min);
    e.y_max = std::max(e.y_max, *y_max);
    e.z_min = std::min(e.z_min, store.z_lower(b));
    e.z_max = std::max(e.z_max, store.z_upper(b));
  }
  return e;
}

}  // namespace

KeepMasks choose_samples(const SlabStore& store, const Cleaning& cleaning, CleanCounts& counts, const RunContext& run) {
  const CleanSettings& settings = cleaning.settings;
  KeepMasks masks(store.buckets());
  for (std::size_t b = 0; b < masks.size(); ++b) masks[b].assign(store.count(b), true);
  Noted noted(masks, static_cast<bool>(cleaning.rejected));
  if (settings.merge) counts.merged = thin_store(store, *settings.merge / cleaning.step, masks, run);
  noted.step(kReasonMerged);
  if (settings.sigma > 0) {
    const Outliers outliers =
        drop_outliers(store, {settings.neighbours, settings.sigma}, cleaning.directory, masks, run);
    counts.outliers = outliers.count;
    counts.outlier_distance = outliers.limit * cleaning.step;
  }
  noted.step(kReasonOutlier);
  if (settings.strays) {
    const StrayCounts strays = drop_strays(store, masks, run, noted.reasons());
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

}  // namespace lamina
