#include "lamina/volume_tools.h"

#include <fmt/format.h>
#include <openvdb/points/PointCount.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>

#include "base/run.h"
#include "lamina/error.h"
#include "vdb/grids.h"
#include "vdb/points_grid.h"
#include "vdb/vdb_file.h"
#include "volume/volume_data.h"

namespace lamina {
namespace {

using openvdb::GridBase;

std::string transform_words(const openvdb::math::Transform& transform) {
  static const std::map<std::string, std::string> words{
      {"ScaleMap", "scale"},
      {"UniformScaleMap", "uniform scale"},
      {"ScaleTranslateMap", "scale, translate"},
      {"UniformScaleTranslateMap", "uniform scale, translate"},
      {"TranslationMap", "translate"},
      {"UnitaryMap", "rotation"},
      {"AffineMap", "affine"},
      {"NonlinearFrustumMap", "frustum"},
  };
  const auto found = words.find(transform.mapType());
  return found == words.end() ? std::string(transform.mapType()) : found->second;
}

void describe_transform(const openvdb::math::Transform& transform, GridInfo& out) {
  const openvdb::Vec3d voxel = transform.voxelSize();
  out.voxel = {voxel[0], voxel[1], voxel[2]};
  out.transform_type = transform_words(transform);
  out.linear = transform.isLinear();
  out.uniform = out.linear && transform.hasUniformScale();
  for (std::size_t k = 0; k < 4; ++k) out.index_to_world[k][k] = 1;
  if (!out.linear) return;
  // OpenVDB multiplies row vectors from the left.
  const openvdb::Mat4d m = transform.baseMap()->getAffineMap()->getMat4();
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      out.index_to_world[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] = m(column, row);
}

void describe_bounds(const GridBase& grid, GridInfo& out) {
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  if (box.empty()) return;
  for (int k = 0; k < 3; ++k) {
    out.index_low[static_cast<std::size_t>(k)] = box.min()[k];
    out.index_high[static_cast<std::size_t>(k)] = box.max()[k];
  }
  const openvdb::BBoxd world = grid.transform().indexToWorld(openvdb::BBoxd(box.min().asVec3d(), box.max().asVec3d()));
  for (int k = 0; k < 3; ++k) {
    out.world_low[static_cast<std::size_t>(k)] = world.min()[k];
    out.world_high[static_cast<std::size_t>(k)] = world.max()[k];
  }
}

template <class Grid>
bool describe_values(const GridBase& base, GridInfo& out) {
  if (!base.isType<Grid>()) return false;
  const auto& grid = static_cast<const Grid&>(base);
  bool any = false;
  double low = 0, high = 0;
  for (auto value = grid.cbeginValueOn(); value; ++value) {
    const auto v = static_cast<double>(*value);
    low = any ? std::min(low, v) : v;
    high = any ? std::max(high, v) : v;
    any = true;
  }
  out.value_low = low;
  out.value_high = high;
  return true;
}

void describe_points(const openvdb::points::PointDataGrid& grid, GridInfo& out) {
  out.points = true;
  out.point_count = openvdb::points::pointCount(grid.tree());
  const auto leaf = grid.tree().cbeginLeaf();
  if (!leaf) return;
  std::map<std::size_t, std::string> names;
  const auto& descriptor = leaf->attributeSet().descriptor();
  for (const auto& [name, position] : descriptor.map()) names[position] = name;
  for (const auto& [position, name] : names) {
    const openvdb::NamePair& type = descriptor.type(position);
    out.attributes.emplace_back(
        name, type.second == "null" || type.second.empty() ? type.first : type.first + " " + type.second);
  }
}

std::string background_words(const GridBase& grid) {
  if (grid.isType<openvdb::points::PointDataGrid>()) return {};
  const openvdb::Metadata::Ptr value = grid.constBaseTree().getBackgroundValue();
  return value == nullptr ? std::string() : value->str();
}

GridInfo describe(const GridBase& grid) {
  GridInfo out;
  out.name = grid.getName();
  out.type = grid.valueType();
  out.grid_class = GridBase::gridClassToString(grid.getGridClass());
  out.creator = grid.getCreator();
  out.background = background_words(grid);
  out.half = grid.saveFloatAsHalf();
  out.open = volume::is_open(grid);
  out.active_voxels = grid.activeVoxelCount();
  const openvdb::TreeBase& tree = grid.constBaseTree();
  out.active_tiles = tree.activeTileCount();
  out.leaf_nodes = tree.leafCount();
  out.internal_nodes = tree.nonLeafCount() - 1;  // the root is not counted
  out.memory_bytes = tree.memUsage();
  if (out.leaf_nodes > 0)
    out.leaf_fill = static_cast<double>(tree.activeLeafVoxelCount()) / (512.0 * static_cast<double>(out.leaf_nodes));
  describe_bounds(grid, out);
  describe_transform(grid.transform(), out);
  describe_values<openvdb::FloatGrid>(grid, out) || describe_values<openvdb::DoubleGrid>(grid, out) ||
      describe_values<openvdb::Int32Grid>(grid, out) || describe_values<openvdb::Int64Grid>(grid, out);
  if (grid.isType<openvdb::points::PointDataGrid>())
    describe_points(static_cast<const openvdb::points::PointDataGrid&>(grid), out);
  for (auto item = grid.beginMeta(); item != grid.endMeta(); ++item)
    out.metadata.emplace_back(item->first, item->second->str());
  return out;
}

}  // namespace

VolumeInfo describe_volume(const std::string& path) {
  const volume::VdbFile file = volume::read_vdb(path);
  VolumeInfo out{path, file.version, file.bytes, {}};
  for (const auto& grid : file.grids) out.grids.push_back(describe(*grid));
  return out;
}

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
