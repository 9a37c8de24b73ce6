#include <fmt/format.h>
#include <openvdb/tools/ValueTransformer.h>
#include <openvdb/tools/VectorTransformer.h>

#include <cmath>

#include "lamina/error.h"
#include "lamina/transform.h"
#include "vdb/vdb_file.h"
#include "volume/edited_grids.h"

namespace lamina {
namespace {

using namespace openvdb;

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

VolumeEditStats transform_volume(const std::string& input, const Eigen::Affine3d& transform, const std::string& output,
                                 const RunContext& run) {
  require_invertible(transform.matrix());
  const Mat4d matrix = to_vdb(transform);
  const double scale = scale_of(transform);
  volume::GridEdit edit;
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
  return volume::edit_grids(input, edit, output, run);
}

}  // namespace lamina
