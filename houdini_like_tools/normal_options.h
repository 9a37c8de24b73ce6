// Options and statistics about normals that tools share.
#pragma once
#include <CLI/CLI.hpp>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "lamina/normals.h"
#include "lamina/surface.h"

namespace lamina::tools {

/// --normals.
void add_normals_choice(CLI::App& tool, NormalsChoice& normals, const std::string& group);

/// --k, --radius, --viewpoint, --up, --flip.
void add_normals_options(CLI::App& tool, NormalsSettings& settings, const std::string& group);

nlohmann::ordered_json normals_json(const NormalsReport& report);

}  // namespace lamina::tools
