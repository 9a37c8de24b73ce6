// Cleaning between reading and reconstructing: duplicates, outliers and samples too close together leave a slab store.
#pragma once
#include <functional>
#include <string>

#include "lamina/clean.h"
#include "samples/outliers.h"
#include "store/ingest.h"
#include "store/slab_store.h"

namespace lamina {

/// What is asked for, and where.
struct Cleaning {
  CleanSettings settings;
  double step = 1;        ///< input units per fixed-point step
  std::string directory;  ///< of temporary files
  /// Where given, is told what is left out while the store still has it.
  std::function<void(const Reasons&)> rejected{};
};

/// Carries out the steps that look around; counts go to `counts`. Memory: a bit for each sample and what the steps
/// need. Returns which samples stay, by bucket.
KeepMasks choose_samples(const SlabStore& store, const Cleaning& cleaning, CleanCounts& counts, const RunContext& run);

/// The same on what has been read; the samples left out are never read again. `name`: of the input, for messages.
/// Throws Error(empty) when nothing is left.
void clean_ingested(Ingested& in, const Cleaning& cleaning, const std::string& name, CleanCounts& counts,
                    const RunContext& run);

/// What the settings leave out, in words: others where other samples stay; empty where all do.
std::string cleaning_words(const CleanSettings& settings);

}  // namespace lamina
