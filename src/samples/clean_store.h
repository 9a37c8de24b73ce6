// Cleans a slab store: the samples left out are never read again.
#pragma once
#include <string>

#include "lamina/clean.h"
#include "samples/outliers.h"
#include "store/slab_store.h"

namespace lamina::clean {

/// Carries out the steps that look around; counts go to `counts`. `step`: input units per fixed-point step.
/// Memory: a bit for each sample and what the steps need. Returns the masks by bucket.
KeepMasks choose_samples(const SlabStore& store, const CleanSettings& settings, double step,
                         const std::string& directory, CleanCounts& counts, const RunContext& run);

}  // namespace lamina::clean
