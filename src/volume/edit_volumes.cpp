#include <fmt/format.h>
#include <openvdb/tools/ValueTransformer.h>
#include <openvdb/tools/VectorTransformer.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/run.h"
#include "lamina/attributes.h"
#include "lamina/edit.h"
#include "lamina/error.h"
#include "lamina/volume_points.h"
#include "lamina/volume_tools.h"
#include "vdb/points_grid.h"
#include "vdb/streamed_vdb.h"
#include "vdb/vdb_file.h"

namespace lamina {
namespace {

using namespace openvdb;

/// What to do with a file's grids.
struct GridEdit {
  std::function<void(GridBase&)> grid;  ///< any but points
  std::function<void(SampleBatch&)> points;
};

/// Null when no point is left.
GridBase::Ptr edited_points(const std::string& path, const std::string& name, const GridEdit& edit,
                            VolumeEditStats& stats, const RunContext& run) {
  PointVolume cloud = read_point_volume(path, name);
  for (const std::string& skipped : cloud.skipped)
    run.warn(fmt::format("{}: attribute {} of grid {} is no number and left out", path, skipped, name));
  edit.points(cloud.points.samples);
  if (cloud.points.samples.size() == 0) return nullptr;
  stats.points += cloud.points.samples.size();
  return volume::point_grid(cloud.points);
}

VolumeEditStats edit_all(const std::string& input, const GridEdit& edit, const std::string& output,
                         const RunContext& run) {
  VolumeEditStats stats;
  GridCPtrVec grids;
  for (GridBase::Ptr grid : volume::read_vdb(input).grids) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    const std::string name = grid->getName();
    const bool half = grid->saveFloatAsHalf();
    if (grid->isType<points::PointDataGrid>()) {
      grid = edited_points(input, name, edit, stats, run);
      if (grid == nullptr) continue;
      volume::label(*grid, name, half);
    } else {
      edit.grid(*grid);
      if (grid->empty() || grid->activeVoxelCount() == 0) continue;
      volume::label(*grid, name, grid->saveFloatAsHalf());
    }
    stats.voxels += grid->activeVoxelCount();
    grids.push_back(grid);
  }
  stats.grids = grids.size();
  if (grids.empty()) throw Error(ExitCode::empty, fmt::format("{}: nothing of its grids is left", input));
  stats.bytes = volume::write_vdb(grids, output);
  return stats;
}

/// Reads, edits and writes: grids in, grids out, points by themselves. Grids of which nothing is left are left out.
VolumeEditStats edit_grids(const std::string& input, const GridEdit& edit, const std::string& output,
                           const RunContext& run) {
  VolumeEditStats stats;
  with_threads(run.threads, [&] { stats = edit_all(input, edit, output, run); });
  return stats;
}

/// The region as a grid sees it.
class VoxelRegion {
 public:
  VoxelRegion(const ClipRegion& region, Keep keep, const math::Transform& transform)
      : region_(region), keep_(keep), transform_(transform) {}

  [[nodiscard]] bool keeps(const Coord& at) const { return inside(at) == (keep_ == Keep::inside); }

  enum class Part { all, none, some };
  /// Of a cube of voxels; `some` when that is not plain to see. The region is convex, and so is any linear image of the
  /// cube.
  [[nodiscard]] Part part(const Coord& low, Int32 side) const {
    std::vector<Vec3d> corners;
    bool all = transform_.isLinear();
    for (int i = 0; i < 8; ++i) {
      const Coord at = low.offsetBy((i & 1) * (side - 1), (i >> 1 & 1) * (side - 1), (i >> 2) * (side - 1));
      all = all && inside(at);
      corners.push_back(transform_.indexToWorld(at));
    }
    if (all) return keep_ == Keep::inside ? Part::all : Part::none;
    if (transform_.isLinear() && beside(corners)) return keep_ == Keep::inside ? Part::none : Part::all;
    return Part::some;
  }

 private:
  [[nodiscard]] bool inside(const Coord& at) const {
    const Vec3d p = transform_.indexToWorld(at);
    return contains(region_, {p[0], p[1], p[2]});
  }
  /// All corners lie beyond one of the region's faces.
  [[nodiscard]] bool beside(const std::vector<Vec3d>& corners) const {
    const auto all = [&](const auto& beyond) { return std::all_of(corners.begin(), corners.end(), beyond); };
    if (region_.box) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto axis = static_cast<int>(k);
        if (all([&](const Vec3d& c) { return c[axis] < region_.box->low[k]; })) return true;
        if (all([&](const Vec3d& c) { return c[axis] > region_.box->high[k]; })) return true;
      }
    }
    return std::any_of(region_.half_spaces.begin(), region_.half_spaces.end(), [&](const HalfSpace& h) {
      return all([&](const Vec3d& c) {
        double along = 0;
        for (std::size_t k = 0; k < 3; ++k) along += h.normal[k] * (c[static_cast<int>(k)] - h.point[k]);
        return along < 0;
      });
    });
  }

  const ClipRegion& region_;
  Keep keep_;
  const math::Transform& transform_;
};

/// Divides an active tile until its pieces are kept or not; the last become leaves.
template <class Tree>
void cut_tile(Tree& tree, const VoxelRegion& region, const Coord& at, Index level,
              const typename Tree::ValueType& value) {
  const auto side_of = [](Index l) { return Int32{8} << (l > 1 ? 4 : 0) << (l > 2 ? 5 : 0); };
  switch (region.part(at, side_of(level))) {
    case VoxelRegion::Part::all:
      return;
    case VoxelRegion::Part::none:
      tree.addTile(level, at, tree.background(), false);
      return;
    case VoxelRegion::Part::some:
      break;
  }
  if (level == 1) {
    tree.touchLeaf(at);
    return;
  }
  const Int32 step = side_of(level - 1), side = side_of(level);
  for (Int32 x = 0; x < side; x += step) {
    for (Int32 y = 0; y < side; y += step) {
      for (Int32 z = 0; z < side; z += step) {
        const Coord piece = at.offsetBy(x, y, z);
        tree.addTile(level - 1, piece, value, true);
        cut_tile(tree, region, piece, level - 1, value);
      }
    }
  }
}

/// What a voxel becomes that is not kept: outside, or in a level set on the side where it was.
template <class Value>
Value emptied(const Value& /*before*/, const Value& background) {
  return background;
}
float emptied(float before, float background) {
  return before < 0 ? -background : background;
}

/// True when something was taken away.
template <class Grid>
bool clip_grid(Grid& grid, const VoxelRegion& region) {
  using Tree = typename Grid::TreeType;
  using Leaf = typename Tree::LeafNodeType;
  Tree& tree = grid.tree();
  struct Tile {
    Coord at;
    Index level;
    typename Tree::ValueType value;
  };
  std::vector<Tile> tiles;
  auto tile = tree.cbeginValueOn();
  tile.setMaxDepth(Tree::ValueOnCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) tiles.push_back({tile.getCoord(), tile.getLevel(), *tile});
  const Index64 before = tree.activeVoxelCount();
  for (const Tile& t : tiles) cut_tile(tree, region, t.at, t.level, t.value);

  const bool level_set = grid.getGridClass() == GRID_LEVEL_SET;
  std::vector<Leaf*> leaves;
  tree.getNodes(leaves);
  tbb::parallel_for(std::size_t{0}, leaves.size(), [&](std::size_t i) {
    Leaf& leaf = *leaves[i];
    for (auto value = leaf.beginValueOn(); value; ++value) {
      if (region.keeps(value.getCoord())) continue;
      const Index at = value.pos();
      leaf.setValueOff(at, level_set ? emptied(leaf.getValue(at), tree.background()) : tree.background());
    }
  });
  std::vector<Coord> empty;
  for (const Leaf* leaf : leaves)
    if (leaf->isEmpty()) empty.push_back(leaf->origin());
  for (const Coord& at : empty) tree.addTile(1, at, tree.background(), false);
  return tree.activeVoxelCount() < before;
}

using Grids = TypeList<FloatGrid, DoubleGrid, Vec3SGrid, Vec3DGrid, Int32Grid, Int64Grid, BoolGrid, MaskGrid>;

/// OpenVDB multiplies rows from the left.
Mat4d to_vdb(const Eigen::Affine3d& transform) {
  Mat4d out;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) out(j, i) = transform.matrix()(i, j);
  return out;
}

/// The one scale of all lengths, or 0 where there is none.
double scale_of(const Eigen::Affine3d& transform) {
  const Eigen::Matrix3d m = transform.linear();
  const double scale = std::cbrt(std::abs(m.determinant()));
  const Eigen::Matrix3d off = m.transpose() * m / (scale * scale) - Eigen::Matrix3d::Identity();
  constexpr double kRounding = 1e-9;
  return off.cwiseAbs().maxCoeff() < kRounding ? scale : 0;
}

template <class Grid>
bool scale_values(GridBase& base, double scale) {
  if (!base.isType<Grid>()) return false;
  auto& grid = static_cast<Grid&>(base);
  using Value = typename Grid::ValueType;
  const auto by = static_cast<Value>(scale);
  if (by == 1) return true;
  tools::foreach (grid.beginValueAll(), [by](const auto& at) { at.setValue(*at * by); });
  grid.tree().root().setBackground(grid.background() * by, false);
  // 16-bit floats end at 65504, and have steps of 2^-24 near zero.
  const double voxel = grid.voxelSize()[0], band = static_cast<double>(grid.background());
  if (!(band * scale < 65504 && voxel * scale > 1000 * 0x1p-24)) grid.setSaveFloatAsHalf(false);
  return true;
}

template <class Grid>
void turn_vectors(GridBase& grid, const Mat4d& matrix) {
  if (grid.isType<Grid>()) tools::transformVectors(static_cast<Grid&>(grid), matrix);
}

}  // namespace

VolumeEditStats clip_volume(const std::string& input, const ClipRegion& region, Keep keep, const std::string& output,
                            const RunContext& run) {
  require_sane(region);
  GridEdit edit;
  edit.points = [&](SampleBatch& points) { clip_rows(points, region, keep); };
  edit.grid = [&](GridBase& grid) {
    const VoxelRegion voxels(region, keep, grid.transform());
    bool cut = false;
    if (!grid.apply<Grids>([&](auto& typed) { cut = clip_grid(typed, voxels); })) {
      throw Error(ExitCode::usage, fmt::format("{}: grid {}: {} cannot be clipped; take it out of the file first",
                                               input, grid.getName(), volume::kind_of(grid)));
    }
    if (!cut || grid.getGridClass() != GRID_LEVEL_SET || !grid.isType<FloatGrid>()) return;
    grid.insertMeta(volume::kOpenMetadata, BoolMetadata(true));
    volume::sign_tiles(static_cast<FloatGrid&>(grid));
  };
  return edit_grids(input, edit, output, run);
}

VolumeEditStats transform_volume(const std::string& input, const Eigen::Affine3d& transform, const std::string& output,
                                 const RunContext& run) {
  require_invertible(transform.matrix());
  const Mat4d matrix = to_vdb(transform);
  const double scale = scale_of(transform);
  GridEdit edit;
  edit.points = [&](SampleBatch& points) { transform_rows(points, transform); };
  edit.grid = [&](GridBase& grid) {
    if (!grid.transform().isLinear()) {
      throw Error(ExitCode::unreadable,
                  fmt::format("{}: grid {} has a frustum (perspective) transform; resample it to cubic voxels first",
                              input, grid.getName()));
    }
    if (grid.getGridClass() == GRID_LEVEL_SET) {
      if (!(scale > 0)) {
        throw Error(ExitCode::usage,
                    fmt::format("{}: grid {} is a level set: stretched or sheared its values would be no distances; "
                                "convert it to a mesh, transform that, and convert it back",
                                input, grid.getName()));
      }
      if (!scale_values<FloatGrid>(grid, scale)) scale_values<DoubleGrid>(grid, scale);
    }
    turn_vectors<Vec3SGrid>(grid, matrix);
    turn_vectors<Vec3DGrid>(grid, matrix);
    // A transform may serve several grids of the file.
    grid.setTransform(grid.transform().copy());
    grid.transform().postMult(matrix);
  };
  return edit_grids(input, edit, output, run);
}

}  // namespace lamina
