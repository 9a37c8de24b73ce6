#include "volume/edited_grids.h"

#include <fmt/format.h>

#include <utility>

#include "base/run.h"
#include "lamina/error.h"
#include "lamina/volume_points.h"
#include "vdb/point_grids.h"
#include "vdb/points_grid.h"
#include "vdb/vdb_file.h"

namespace lamina::volume {
namespace {

using openvdb::GridBase;

/// Null when no point is left.
GridBase::Ptr edited_points(const std::string& path, const std::string& name, const GridEdit& edit,
                            VolumeEditStats& stats, const RunContext& run) {
  PointVolume volume = read_point_volume(path, name);
  for (const std::string& skipped : volume.skipped)
    run.warn(fmt::format("{}: attribute {} of grid {} is no number and left out", path, skipped, name));
  edit.points(volume.points.samples);
  if (volume.points.samples.size() == 0) return nullptr;
  stats.points += volume.points.samples.size();
  const double voxel = point_voxel(volume.points.samples, 0);
  return point_grid(volume.points, point_columns(volume.points), point_transform(volume.points, voxel));
}

VolumeEditStats edit_all(const std::string& input, const GridEdit& edit, const std::string& output,
                         const RunContext& run) {
  VolumeEditStats stats;
  openvdb::GridCPtrVec grids;
  for (GridBase::Ptr grid : read_vdb(input).grids) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    const std::string name = grid->getName();
    const bool half = grid->saveFloatAsHalf();
    if (grid->isType<openvdb::points::PointDataGrid>()) {
      grid = edited_points(input, name, edit, stats, run);
      if (grid == nullptr) continue;
      label(*grid, name, half);
    } else {
      edit.grid(*grid);
      if (grid->empty() || grid->activeVoxelCount() == 0) continue;
      label(*grid, name, grid->saveFloatAsHalf());
    }
    stats.voxels += grid->activeVoxelCount();
    grids.push_back(grid);
  }
  stats.grids = grids.size();
  if (grids.empty()) throw Error(ExitCode::empty, fmt::format("{}: nothing of its grids is left", input));
  stats.bytes = write_vdb(grids, output);
  return stats;
}

}  // namespace

VolumeEditStats edit_grids(const std::string& input, const GridEdit& edit, const std::string& output,
                           const RunContext& run) {
  VolumeEditStats stats;
  with_threads(run.threads, [&] { stats = edit_all(input, edit, output, run); });
  return stats;
}

}  // namespace lamina::volume
