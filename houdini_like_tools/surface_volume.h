// The options of the grids written beside a mesh.
#pragma once
#include <CLI/CLI.hpp>

#include "lamina/surface.h"

namespace lamina::tools {

void add_volume_options(CLI::App& tool, VolumeExport& v);

}  // namespace lamina::tools
