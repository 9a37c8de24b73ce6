// The colours of a .vdb beside its level set or fog.
#pragma once

#include <optional>

#include "render/shade.h"
#include "vdb/grids.h"

namespace lamina::render_detail {

/// Looks colours up on one thread: it remembers the nodes it was in.
class GridColours {
 public:
  /// `grid`: `Cd`, 0 to 1; null where there is none.
  explicit GridColours(openvdb::Vec3SGrid::ConstPtr grid);
  /// Interpolated; nothing where there is no grid.
  [[nodiscard]] std::optional<Rgb> at(const openvdb::Vec3d& world) const;

 private:
  openvdb::Vec3SGrid::ConstPtr grid_;
  std::optional<openvdb::Vec3SGrid::ConstAccessor> values_;
};

}  // namespace lamina::render_detail
