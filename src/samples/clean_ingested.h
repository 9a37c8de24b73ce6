// Cleaning between reading and reconstructing.
#pragma once
#include <string>

#include "lamina/clean.h"
#include "store/ingest.h"

namespace lamina {

/// Carries out the steps that look around on what has been read; the samples left out are never read again. `step`:
/// input units per fixed-point step. Throws Error(empty) when nothing is left.
void clean_ingested(Ingested& in, const CleanSettings& settings, double step, const std::string& name,
                    const std::string& directory, CleanCounts& counts, const RunContext& run);

/// What the settings leave out, in words: others where other samples stay; empty where all do.
std::string cleaning_words(const CleanSettings& settings);

}  // namespace lamina
