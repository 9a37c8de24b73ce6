#include "lamina/volume_tools.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <cstddef>
#include <string>

#include "base/run.h"
#include "lamina/error.h"
#include "vdb/grids.h"
#include "volume/volume_data.h"

namespace lamina {
namespace {

/// Where the voxels lie. Throws Error(usage) for transforms that arrays cannot have.
struct VoxelPlaces {
  explicit VoxelPlaces(const openvdb::FloatGrid& grid, const std::string& name) {
    const openvdb::math::Transform& transform = grid.transform();
    const openvdb::Vec3d zero = transform.indexToWorld(openvdb::Vec3d(0.0));
    edge = transform.voxelSize()[0];
    for (int k = 0; k < 3; ++k) {
      openvdb::Vec3d step(0.0);
      step[k] = 1;
      const openvdb::Vec3d along = transform.indexToWorld(step) - zero;
      openvdb::Vec3d straight(0.0);
      straight[k] = edge;
      if (!transform.isLinear() || (along - straight).length() > 1e-9 * edge) {
        throw Error(ExitCode::usage, fmt::format("{}: its voxels are no cubes along the axes, which arrays have; "
                                                 "'lamina convert' makes a mesh of it, 'lamina volume' a grid of that",
                                                 name));
      }
      origin[static_cast<std::size_t>(k)] = zero[k];
    }
  }
  std::array<double, 3> origin{};
  double edge = 0;
};

void require_room(double bytes, const std::string& name, const RunContext& run) {
  const std::uint64_t most = run.max_memory > 0 ? run.max_memory : machine_memory();
  if (most == 0 || bytes <= static_cast<double>(most)) return;
  throw Error(ExitCode::budget,
              fmt::format("{}: as an array it needs {:.0f} MB, {} {:.0f} MB; take the sparse voxels, or larger ones",
                          name, bytes / 1e6, run.max_memory > 0 ? "--max-memory allows" : "the machine has",
                          static_cast<double>(most) / 1e6));
}

DenseVoxels dense(const openvdb::FloatGrid& grid, const std::string& name, const RunContext& run) {
  const VoxelPlaces places(grid, name);
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  DenseVoxels out;
  out.edge = places.edge;
  double count = 1;
  for (int k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(k);
    out.size[i] = std::int64_t{box.max()[k]} - box.min()[k] + 1;
    out.origin[i] = places.origin[i] + places.edge * box.min()[k];
    count *= static_cast<double>(out.size[i]);
  }
  require_room(count * sizeof(float), name, run);
  out.values.resize(static_cast<std::size_t>(out.size[0] * out.size[1] * out.size[2]));
  with_threads(run.threads, [&] {
    tbb::parallel_for(std::int64_t{0}, out.size[0], [&](std::int64_t i) {
      if (run.cancelled()) return;
      const openvdb::FloatGrid::ConstAccessor voxels = grid.getConstAccessor();
      float* to = out.values.data() + i * out.size[1] * out.size[2];
      openvdb::Coord at = box.min().offsetBy(static_cast<int>(i), 0, 0);
      for (at[1] = box.min()[1]; at[1] <= box.max()[1]; ++at[1])
        for (at[2] = box.min()[2]; at[2] <= box.max()[2]; ++at[2]) *to++ = voxels.getValue(at);
    });
  });
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  return out;
}

SparseVoxels sparse(const openvdb::FloatGrid& grid, const std::string& name, const RunContext& run) {
  const VoxelPlaces places(grid, name);
  SparseVoxels out;
  out.origin = places.origin;
  out.edge = places.edge;
  const std::uint64_t count = grid.activeVoxelCount();
  require_room(static_cast<double>(count) * (sizeof(float) + 3 * sizeof(std::int32_t)), name, run);
  out.indices.reserve(count);
  out.values.reserve(count);
  for (auto value = grid.cbeginValueOn(); value; ++value) {
    openvdb::CoordBBox box;
    value.getBoundingBox(box);
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    for (const openvdb::Coord& at : box) {
      out.indices.push_back({at[0], at[1], at[2]});
      out.values.push_back(*value);
    }
  }
  return out;
}

}  // namespace

DenseVoxels dense_voxels(const LevelSet& level_set, const RunContext& run) {
  return dense(*level_set.data().grid, level_set.name(), run);
}
DenseVoxels dense_voxels(const FogVolume& fog, const RunContext& run) {
  return dense(*fog.data().grid, fog.name(), run);
}
SparseVoxels sparse_voxels(const LevelSet& level_set, const RunContext& run) {
  return sparse(*level_set.data().grid, level_set.name(), run);
}
SparseVoxels sparse_voxels(const FogVolume& fog, const RunContext& run) {
  return sparse(*fog.data().grid, fog.name(), run);
}

}  // namespace lamina
