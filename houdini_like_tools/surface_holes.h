// The options, words and statistics of a mesh's holes.
#pragma once
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "lamina/holes.h"
#include "lamina/surface.h"

namespace lamina::tools {

void add_hole_options(CLI::App& tool, SurfaceSettings& settings, const std::string& group);
nlohmann::ordered_json holes_json(const HoleStats& holes);

}  // namespace lamina::tools
