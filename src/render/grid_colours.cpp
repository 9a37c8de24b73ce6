#include "render/grid_colours.h"

#include <openvdb/tools/Interpolation.h>

#include <algorithm>
#include <utility>

namespace lamina::render_detail {

GridColours::GridColours(openvdb::Vec3SGrid::ConstPtr grid) : grid_(std::move(grid)) {
  if (grid_ != nullptr) values_.emplace(grid_->tree());
}

std::optional<Rgb> GridColours::at(const openvdb::Vec3d& world) const {
  if (!values_) return std::nullopt;
  const openvdb::Vec3s c = openvdb::tools::BoxSampler::sample(*values_, grid_->transform().worldToIndex(world));
  Rgb out;
  for (std::size_t i = 0; i < 3; ++i) {
    const float byte = 255 * c[static_cast<int>(i)];
    out[i] = decode(static_cast<std::uint8_t>(byte > 0 ? std::min(byte, 255.0F) + 0.5F : 0.0F));
  }
  return out;
}

}  // namespace lamina::render_detail
