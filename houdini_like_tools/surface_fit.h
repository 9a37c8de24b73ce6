// The options of the fit and of the octree's cells.
#pragma once
#include <CLI/CLI.hpp>

#include "lamina/surface.h"

namespace lamina::tools {

void add_fit_options(CLI::App& tool, SurfaceSettings& settings);

}  // namespace lamina::tools
