#include "surface/clean_ingested.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "clean/clean_store.h"
#include "lamina/error.h"

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

}  // namespace lamina
