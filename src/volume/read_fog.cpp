#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "lamina/error.h"
#include "vdb/vdb_file.h"
#include "volume/fog_data.h"

namespace lamina {
namespace {

using openvdb::GridBase;

/// How well a grid serves as a fog; 0: not at all. Whoever names one may take any numbers for densities.
int fog_fitness(const GridBase& grid, bool named) {
  if (!volume::is_scalar(grid) || grid.getGridClass() == openvdb::GRID_LEVEL_SET) return 0;
  if (grid.getName() == "density") return 3;
  return named || grid.getGridClass() == openvdb::GRID_FOG_VOLUME ? 2 : 0;
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
  const GridBase::Ptr grid = volume::choose_grid(path, file.grids, name, "fog volume", fog_fitness);
  auto data = std::make_shared<FogVolume::Data>();
  data->name = grid->getName();
  data->grid = volume::as_float(grid);
  data->colours = volume::colours_of(file.grids);
  return FogVolume(std::move(data));
}

}  // namespace lamina
