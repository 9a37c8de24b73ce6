#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "lamina/error.h"
#include "volume/fog_data.h"
#include "volume/vdb_file.h"

namespace lamina {
namespace {

using openvdb::GridBase;

bool is_scalar(const GridBase& grid) {
  return grid.isType<openvdb::FloatGrid>() || grid.isType<openvdb::DoubleGrid>();
}

/// How well a grid serves as the fog nobody named; 0: not at all.
int fitness(const GridBase& grid) {
  if (!is_scalar(grid) || grid.getGridClass() == openvdb::GRID_LEVEL_SET) return 0;
  if (grid.getName() == "density") return 3;
  return grid.getGridClass() == openvdb::GRID_FOG_VOLUME ? 2 : 0;
}

GridBase::Ptr choose(const std::string& path, const openvdb::GridPtrVec& grids, const std::string& name) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::unreadable, fmt::format("{}: {}; it holds {}", path, what, volume::list_of(grids)));
  };
  if (name.empty()) {
    const auto best = std::max_element(grids.begin(), grids.end(),
                                       [](const auto& a, const auto& b) { return fitness(*a) < fitness(*b); });
    if (fitness(**best) == 0) refuse("holds no fog volume");
    return *best;
  }
  const auto found = std::find_if(grids.begin(), grids.end(), [&](const auto& g) { return g->getName() == name; });
  if (found == grids.end()) refuse(fmt::format("holds no grid called {}", name));
  if (!is_scalar(**found) || (*found)->getGridClass() == openvdb::GRID_LEVEL_SET)
    refuse(fmt::format("grid {} is no fog volume", name));
  return *found;
}

}  // namespace

FogVolume::FogVolume(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
const std::string& FogVolume::name() const {
  return data_->name;
}
double FogVolume::voxel() const {
  const openvdb::Vec3d v = data_->grid->voxelSize();
  return std::min({v[0], v[1], v[2]});
}

FogVolume read_fog(const std::string& path, const std::string& name) {
  const volume::VdbFile file = volume::read_vdb(path);
  const GridBase::Ptr grid = choose(path, file.grids, name);
  if (!grid->transform().isLinear()) {
    throw Error(ExitCode::unreadable,
                fmt::format("{}: grid {} has a frustum (perspective) transform; resample it to cubic voxels first",
                            path, grid->getName()));
  }
  if (grid->activeVoxelCount() == 0)
    throw Error(ExitCode::unreadable, fmt::format("{}: grid {} has no active voxels", path, grid->getName()));
  auto data = std::make_shared<FogVolume::Data>();
  data->name = grid->getName();
  data->grid = volume::as_float(grid);
  data->colours = volume::colours_of(file.grids);
  return FogVolume(std::move(data));
}

}  // namespace lamina
