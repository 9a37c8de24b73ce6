// What --stats of lamina surface writes: counts, times and memory of a run.
#pragma once
#include <nlohmann/json.hpp>

#include "lamina/surface.h"

namespace lamina::tools {

nlohmann::ordered_json stats_json(const SurfaceStats& stats, const SurfaceSettings& settings);

}  // namespace lamina::tools
