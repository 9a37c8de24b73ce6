// What clipping and transforming volumes have in common: grids in, grids out, points by themselves.
#pragma once

#include <functional>
#include <string>

#include "lamina/run.h"
#include "lamina/sample.h"
#include "lamina/volume_tools.h"
#include "vdb/grids.h"

namespace lamina::volume {

/// What to do with a file's grids.
struct GridEdit {
  std::function<void(openvdb::GridBase&)> grid;  ///< any but points
  std::function<void(SampleBatch&)> points;
};

/// Reads, edits and writes. Grids of which nothing is left are left out.
VolumeEditStats edit_grids(const std::string& input, const GridEdit& edit, const std::string& output,
                           const RunContext& run);

}  // namespace lamina::volume
