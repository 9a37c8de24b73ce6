#include "render/ray_field.h"

#include <openvdb/tools/Interpolation.h>

#include <algorithm>
#include <utility>

namespace lamina::render_detail {

using openvdb::Coord;
using openvdb::Vec3d;

RayField::RayField(const openvdb::FloatGrid& grid, const View& view) : transform_(grid.transform()), view_(view) {
  // Rays begin and end outside the sphere around the grid.
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  const Vec3d low = transform_.indexToWorld(box.min()), high = transform_.indexToWorld(box.max());
  const Vec3d ball = 0.5 * (low + high);
  double radius = 0;
  for (int i = 0; i < 8; ++i) {
    const Coord corner((i & 1) != 0 ? box.max()[0] + 1 : box.min()[0] - 1,
                       (i & 2) != 0 ? box.max()[1] + 1 : box.min()[1] - 1,
                       (i & 4) != 0 ? box.max()[2] + 1 : box.min()[2] - 1);
    radius = std::max(radius, (transform_.indexToWorld(corner) - ball).length());
  }
  const double farthest = to_vdb(view.toward).dot(ball - to_vdb(view.centre)) + radius;
  start_ = std::min<double>(farthest, view.near);
  length_ = start_ - farthest + 2 * radius;
}

PixelRay RayField::ray(int row, int column) const {
  const double right = (column + 0.5 - 0.5 * view_.tile.width) / view_.scale;
  const double up = (0.5 * view_.tile.height - row - 0.5) / view_.scale;
  const Vec3d begin = to_vdb(view_.centre + right * view_.right + up * view_.up + start_ * view_.toward);
  const Vec3d from = transform_.worldToIndex(begin);
  const Vec3d to = transform_.worldToIndex(begin - length_ * to_vdb(view_.toward));
  const double steps = (to - from).length();
  return {view_.tile.x + column, view_.tile.y + row, from, (to - from) / steps, steps};
}

GridColours::GridColours(openvdb::Vec3SGrid::ConstPtr grid) : grid_(std::move(grid)) {
  if (grid_ != nullptr) values_.emplace(grid_->tree());
}

std::optional<Rgb> GridColours::at(const openvdb::Vec3d& world) const {
  if (!values_) return std::nullopt;
  const openvdb::Vec3s c = openvdb::tools::BoxSampler::sample(*values_, grid_->transform().worldToIndex(world));
  Rgb out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = decode(255 * c[static_cast<int>(i)]);
  }
  return out;
}

}  // namespace lamina::render_detail
