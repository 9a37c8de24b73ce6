#include "samples/clean_store.h"

#include "lamina/error.h"
#include "samples/thinner.h"

namespace lamina::clean {
namespace {

std::uint64_t thin(const SlabStore& store, double distance, KeepMasks& masks, const RunContext& run) {
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

}  // namespace

KeepMasks choose_samples(const SlabStore& store, const CleanSettings& settings, double step,
                         const std::string& directory, CleanCounts& counts, const RunContext& run) {
  KeepMasks masks(store.buckets());
  for (std::size_t b = 0; b < masks.size(); ++b) masks[b].assign(store.count(b), true);
  if (settings.merge) counts.merged = thin(store, *settings.merge / step, masks, run);
  if (settings.sigma > 0) {
    const Outliers outliers = drop_outliers(store, {settings.neighbours, settings.sigma}, directory, masks, run);
    counts.outliers = outliers.count;
    counts.outlier_distance = outliers.limit * step;
  }
  if (settings.spacing > 0) counts.thinned = thin(store, settings.spacing / step, masks, run);
  return masks;
}

}  // namespace lamina::clean
