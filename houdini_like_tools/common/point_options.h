// Options for what happens to points before they are reconstructed, shared by the tools that can: cleaning, and
// normals.
#pragma once
#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "lamina/clean.h"
#include "lamina/normals.h"
#include "lamina/surface.h"

namespace lamina::tools {

/// --clip, --every, --merge, --outliers, --neighbours, --spacing.
void add_clean_options(CLI::App& app, CleanSettings& settings, const std::string& group);

/// --align.
void add_align(CLI::App& tool, bool& align, const std::string& group);

/// --normals.
void add_normals_choice(CLI::App& tool, std::optional<NormalsChoice>& normals, const std::string& group);

/// --k, --radius, --viewpoint, --up, --flip.
void add_normals_options(CLI::App& tool, NormalsSettings& settings, const std::string& group);

}  // namespace lamina::tools
