// `lamina surface` as several processes that mpirun started.
#pragma once
#include <nlohmann/json_fwd.hpp>

#include "lamina/ranks.h"
#include "surface_parts.h"

namespace lamina::tools {

/// Runs this process's share. Throws Error(usage) for options that several processes cannot meet together.
RanksStats run_ranks(const SurfaceSettings& settings, const PartsOptions& parts, const RunContext& context);

/// A line per rank, for the reader.
void report_ranks(const std::vector<RankStats>& ranks, const RunContext& context);

nlohmann::ordered_json ranks_json(const std::vector<RankStats>& ranks);

}  // namespace lamina::tools
