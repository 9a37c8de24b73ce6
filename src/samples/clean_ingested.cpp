#include "samples/clean_ingested.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "lamina/error.h"
#include "samples/clean_store.h"

namespace lamina {
namespace {

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

void clean_ingested(Ingested& in, const CleanSettings& settings, double step, const std::string& name,
                    const std::string& directory, CleanCounts& counts, const RunContext& run) {
  in.store.keep_only(clean::choose_samples(in.store, settings, step, directory, counts, run));
  if (in.store.total() == 0)
    throw Error(ExitCode::empty, fmt::format("{}: cleaning has left no samples ({})", name, describe(counts)));
  // Far outliers would have the sweep go through their emptiness.
  if (counts.merged + counts.outliers + counts.thinned > 0) in.extent = extent_of(in.store);
}

std::string cleaning_words(const CleanSettings& settings) {
  // Every setting by name: one that is added must be dealt with here, or this does not compile.
  const auto& [pick, merge, sigma, neighbours, spacing] = settings;
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
  add(spacing > 0, fmt::format("spacing {}", spacing));
  return words;
}

}  // namespace lamina
