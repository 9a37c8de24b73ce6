#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/run.h"
#include "lamina/error.h"
#include "vdb/points_grid.h"
#include "vdb/vdb_file.h"

namespace lamina {
namespace {

[[noreturn]] void refuse(const std::string& message) {
  throw Error(ExitCode::usage, message);
}

void check(const PointArrays& points, const PointVolumeSettings& settings) {
  const SampleBatch& s = points.samples;
  if (settings.name.empty()) refuse("--name must be a word");
  if (!(settings.voxel >= 0 && std::isfinite(settings.voxel))) refuse("--voxelsize must be a positive length, or 0");
  if (s.size() == 0) throw Error(ExitCode::empty, "there are no points to write");
  bool equal = s.y.size() == s.size() && s.z.size() == s.size() && s.attributes.size() == points.layout.size() &&
               s.ny.size() == s.nx.size() && s.nz.size() == s.nx.size();
  for (const auto* a : {&s.nx, &s.radius, &s.quality}) equal = equal && (a->empty() || a->size() == s.size());
  for (const auto& a : s.attributes) equal = equal && a.size() == s.size();
  if (!equal) refuse("the points' arrays differ in length");
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (std::isfinite(s.x[i]) && std::isfinite(s.y[i]) && std::isfinite(s.z[i])) continue;
    throw Error(ExitCode::unreadable,
                fmt::format("row {} (counted from 0) has a coordinate that is not finite; remove it first", i));
  }
}

}  // namespace

PointVolumeStats write_point_volume(const PointArrays& points, const PointVolumeSettings& settings,
                                    const std::string& path, const RunContext& run) {
  check(points, settings);
  openvdb::initialize();
  PointVolumeStats stats;
  with_threads(run.threads, [&] {
    const auto columns = volume::point_columns(points);
    stats.voxel = volume::point_voxel(points.samples, settings.voxel);
    const auto grid = volume::point_grid(points, columns, volume::point_transform(points, stats.voxel), run.max_memory);
    volume::label(*grid, settings.name, false);
    stats.points = points.samples.size();
    stats.voxels = grid->activeVoxelCount();
    stats.bytes = volume::write_vdb({grid}, path);
  });
  return stats;
}

}  // namespace lamina
