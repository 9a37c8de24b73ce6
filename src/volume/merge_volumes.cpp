#include "lamina/volume_tools.h"

#include <fmt/format.h>
#include <openvdb/tools/Composite.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/run.h"
#include "lamina/error.h"
#include "lamina/volume_points.h"
#include "vdb/points_grid.h"
#include "vdb/streamed_vdb.h"
#include "vdb/vdb_file.h"

namespace lamina {
namespace {

using namespace openvdb;

struct Source {
  std::string path;
  GridBase::Ptr grid;
};

void require_same(const Source& a, const Source& b) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::usage, fmt::format("grid {} of {} and of {} differ in {}; rename one, or resample it first",
                                             a.grid->getName(), a.path, b.path, what));
  };
  if (a.grid->type() != b.grid->type()) refuse(fmt::format("type ({} and {})", a.grid->type(), b.grid->type()));
  if (a.grid->isType<points::PointDataGrid>()) return;
  if (a.grid->getGridClass() != b.grid->getGridClass()) {
    refuse(fmt::format("class ({} and {})", GridBase::gridClassToString(a.grid->getGridClass()),
                       GridBase::gridClassToString(b.grid->getGridClass())));
  }
  if (a.grid->transform() != b.grid->transform()) refuse("transform");
  if (!a.grid->isType<FloatGrid>()) return;
  const float wide = gridPtrCast<FloatGrid>(a.grid)->background(), other = gridPtrCast<FloatGrid>(b.grid)->background();
  if (std::abs(wide - other) > 1e-3F * std::abs(wide))
    refuse(fmt::format("the width of the band ({:g} and {:g})", wide, other));
}

/// Where both have a voxel the nearer distance counts.
void unite_open(FloatTree& to, FloatTree& from) {
  for (auto leaf = from.beginLeaf(); leaf; ++leaf) {
    FloatTree::LeafNodeType* mine = to.probeLeaf(leaf->origin());
    if (mine == nullptr) continue;
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      const Index at = value.pos();
      if (!mine->isValueOn(at) || std::abs(*value) < std::abs(mine->getValue(at))) mine->setValueOn(at, *value);
    }
  }
  to.merge(from, MERGE_ACTIVE_STATES);
}

void unite_level_sets(FloatGrid& to, FloatGrid& from) {
  if (volume::is_open(to) || volume::is_open(from)) {
    unite_open(to.tree(), from.tree());
    to.insertMeta(volume::kOpenMetadata, BoolMetadata(true));
  } else {
    tools::csgUnion(to, from);
  }
}

template <class Grid>
bool merge_as(const GridBase::Ptr& to, const GridBase::Ptr& from) {
  if (!to->isType<Grid>()) return false;
  gridPtrCast<Grid>(to)->tree().merge(gridPtrCast<Grid>(from)->tree(), MERGE_ACTIVE_STATES);
  return true;
}

GridBase::Ptr merge_grids(const std::vector<Source>& sources) {
  GridBase::Ptr first = sources[0].grid;
  const bool level_set = first->isType<FloatGrid>() && first->getGridClass() == GRID_LEVEL_SET;
  for (std::size_t i = 1; i < sources.size(); ++i) {
    const GridBase::Ptr& next = sources[i].grid;
    if (level_set) {
      unite_level_sets(*gridPtrCast<FloatGrid>(first), *gridPtrCast<FloatGrid>(next));
    } else if (!(merge_as<FloatGrid>(first, next) || merge_as<Vec3SGrid>(first, next) ||
                 merge_as<DoubleGrid>(first, next) || merge_as<Vec3DGrid>(first, next) ||
                 merge_as<Int32Grid>(first, next) || merge_as<Int64Grid>(first, next) ||
                 merge_as<BoolGrid>(first, next) || merge_as<MaskGrid>(first, next))) {
      throw Error(ExitCode::usage, fmt::format("grid {} of {} and of {}: grids of type {} cannot be merged",
                                               first->getName(), sources[0].path, sources[i].path, first->type()));
    }
  }
  if (level_set && sources.size() > 1 && volume::is_open(*first)) volume::sign_tiles(*gridPtrCast<FloatGrid>(first));
  return first;
}

std::vector<float>& column(PointArrays& points, const AttributeSpec& spec, const std::string& path) {
  for (std::size_t i = 0; i < points.layout.size(); ++i) {
    if (points.layout[i].name != spec.name) continue;
    if (points.layout[i].type != spec.type)
      throw Error(ExitCode::usage, fmt::format("{}: attribute {} has another type than in the files before; rename it",
                                               path, spec.name));
    return points.samples.attributes[i];
  }
  points.layout.push_back(spec);
  return points.samples.attributes.emplace_back();
}

void append(PointArrays& to, const PointArrays& from, const std::string& path, const RunContext& run) {
  SampleBatch& a = to.samples;
  const SampleBatch& b = from.samples;
  const std::size_t before = a.size(), after = before + b.size();
  bool lacking = false;
  const auto join = [&](auto& into, const auto& more) {
    lacking = lacking || (before > 0 && into.empty() != more.empty());
    if (into.empty() && more.empty()) return;
    into.resize(before);
    into.insert(into.end(), more.begin(), more.end());
    into.resize(after);
  };
  join(a.x, b.x), join(a.y, b.y), join(a.z, b.z);
  join(a.nx, b.nx), join(a.ny, b.ny), join(a.nz, b.nz);
  join(a.radius, b.radius), join(a.quality, b.quality);
  for (std::size_t i = 0; i < from.layout.size(); ++i) join(column(to, from.layout[i], path), b.attributes[i]);
  for (auto& values : a.attributes) {
    lacking = lacking || values.size() != after;
    values.resize(after);
  }
  if (lacking)
    run.warn(fmt::format("{}: its points have other attributes than the files before; what is missing is 0", path));
}

GridBase::Ptr merge_points(const std::vector<Source>& sources, const std::string& name, const RunContext& run) {
  PointArrays all;
  for (const Source& s : sources) append(all, read_point_volume(s.path, name).points, s.path, run);
  return volume::point_grid(all);
}

VolumeMergeStats merge(const std::vector<std::string>& inputs, const std::string& output, const RunContext& run) {
  std::map<std::string, std::vector<Source>> by_name;
  for (const std::string& path : inputs) {
    for (const auto& grid : volume::read_vdb(path).grids) {
      auto& sources = by_name[grid->getName()];
      sources.push_back({path, grid});
      require_same(sources.front(), sources.back());
    }
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  }
  VolumeMergeStats stats;
  GridCPtrVec grids;
  for (auto& [name, sources] : by_name) {
    const bool half = sources[0].grid->saveFloatAsHalf();
    const bool points = sources[0].grid->isType<openvdb::points::PointDataGrid>();
    const GridBase::Ptr grid = points && sources.size() > 1 ? merge_points(sources, name, run) : merge_grids(sources);
    volume::label(*grid, name, half);
    stats.voxels += grid->activeVoxelCount();
    if (points) {
      for (auto leaf = gridPtrCast<openvdb::points::PointDataGrid>(grid)->tree().cbeginLeaf(); leaf; ++leaf)
        stats.points += leaf->pointCount();
    }
    grids.push_back(grid);
  }
  stats.grids = grids.size();
  stats.bytes = volume::write_vdb(grids, output);
  return stats;
}

}  // namespace

VolumeMergeStats merge_volumes(const std::vector<std::string>& inputs, const std::string& output,
                               const RunContext& run) {
  if (inputs.empty()) throw Error(ExitCode::usage, "name the .vdb files to merge");
  VolumeMergeStats stats;
  with_threads(run.threads, [&] { stats = merge(inputs, output, run); });
  return stats;
}

}  // namespace lamina
