#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "lamina/error.h"
#include "vdb/vdb_file.h"
#include "volume/level_set_data.h"

namespace lamina {
namespace {

using openvdb::GridBase;

/// How well a grid serves as the level set nobody named; 0: not at all.
int level_set_fitness(const GridBase& grid, bool /*named*/) {
  if (!volume::is_scalar(grid)) return 0;
  const openvdb::GridClass kind = grid.getGridClass();
  if (kind == openvdb::GRID_LEVEL_SET) return grid.getName() == "surface" ? 4 : 3;
  return kind == openvdb::GRID_UNKNOWN ? 1 : 0;
}

}  // namespace

LevelSet::LevelSet(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
const std::string& LevelSet::name() const {
  return data_->name;
}
double LevelSet::voxel() const {
  const openvdb::Vec3d v = data_->grid->voxelSize();
  return std::min({v[0], v[1], v[2]});
}
double LevelSet::band() const {
  return data_->grid->background();
}
bool LevelSet::open() const {
  return data_->open;
}

LevelSet read_level_set(const std::string& path, const std::string& name) {
  const volume::VdbFile file = volume::read_vdb(path);
  const GridBase::Ptr grid = volume::choose_grid(path, file.grids, name, "level set", level_set_fitness);
  auto data = std::make_shared<LevelSet::Data>();
  data->name = grid->getName();
  data->path = path;
  data->open = volume::is_open(*grid);
  data->grid = volume::as_float(grid);
  data->colours = volume::colours_of(file.grids);
  if (!(data->grid->background() > 0)) {
    throw Error(ExitCode::unreadable, fmt::format("{}: grid {} is no level set: outside its band stands {}, not the "
                                                  "band's width",
                                                  path, data->name, data->grid->background()));
  }
  return LevelSet(std::move(data));
}

}  // namespace lamina
