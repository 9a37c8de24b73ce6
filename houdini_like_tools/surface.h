// The options of `lamina surface`, for whoever runs it without a command line, too.
#pragma once
#include "lamina/surface.h"

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/console.h"
#include "common/parts.h"
#include "lamina/normals.h"
#include "lamina/run.h"
#include "tables.h"

namespace lamina::tools {

/// What `lamina surface` is told.
struct SurfaceOptions {
  std::vector<std::string> inputs, outputs;
  SurfaceSettings settings;
  RunOptions run;
  PartsOptions parts;
  SimplifyGoal simplify;
  std::string stats, preview;
  bool raw = false;
  std::optional<Trade> preset;
  CLI::App* tool = nullptr;  ///< knows which options were given
};

/// Adds all of them but the input and --output, and sets what stands where one is not given.
void add_surface_options(CLI::App& tool, SurfaceOptions& options);

/// The settings that the options come to; input and output stay empty. Says through `context` what a preset sets.
SurfaceSettings surface_settings(SurfaceOptions& options, const RunContext& context);

}  // namespace lamina::tools
