// Statistics as JSON: what --stats writes. docs/statistics.md describes every field.
#pragma once
#include <nlohmann/json.hpp>
#include <vector>

#include "lamina/holes.h"
#include "lamina/normals.h"
#include "lamina/ranks.h"
#include "lamina/surface.h"

namespace lamina::tools {

/// Counts, times and memory of a run of `lamina surface`.
nlohmann::ordered_json stats_json(const SurfaceStats& stats, const SurfaceSettings& settings);
nlohmann::ordered_json normals_json(const NormalsReport& report);
nlohmann::ordered_json holes_json(const HoleStats& holes);
nlohmann::ordered_json ranks_json(const std::vector<RankStats>& ranks);

}  // namespace lamina::tools
