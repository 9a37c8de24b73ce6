// Options of `lamina surface` by subject.
#pragma once
#include <CLI/CLI.hpp>
#include <string>

#include "lamina/surface.h"

namespace lamina::tools {

/// The fit, and the octree's cells.
void add_fit_options(CLI::App& tool, SurfaceSettings& settings);
/// The mesh's holes.
void add_hole_options(CLI::App& tool, SurfaceSettings& settings, const std::string& group);
/// The grids written beside the mesh.
void add_volume_options(CLI::App& tool, VolumeExport& v);

}  // namespace lamina::tools
