// From bricks of the band to the leaves of the grids.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/frame.h"
#include "levelset/band.h"
#include "levelset/grid_frame.h"
#include "vdb/grids.h"
#include "vdb/streamed_vdb.h"

namespace lamina::volume {

/// A grid beside the distances: from the normals, or from channels of the window.
struct ExtraGrid {
  enum class Kind { normal, vector, scalar, weight };
  std::string name;
  Kind kind = Kind::scalar;
  std::array<int, 3> channels{};  ///< index into BandSettings::channels; one for scalars
  float scale = 1;                ///< values are multiplied by this
};

/// The grids called for, and the channels they need. Throws Error(usage) naming one that nobody knows.
std::vector<ExtraGrid> resolve_grids(const std::vector<std::string>& names, const AttributeLayout& layout, double step,
                                     std::vector<int>& channels);

struct BrickLeaves {
  bool any = false;
  std::vector<PackedLeaf> leaves;  ///< the distances', then one for each extra grid
};

struct LeafMaker {
  /// `rotation`: of the frame.
  LeafMaker(const Band& band, const GridFrame& grid, const std::vector<ExtraGrid>& extras,
            const Eigen::Matrix3d& rotation, bool half);

  const Band& band;
  const GridFrame& grid;
  const std::vector<ExtraGrid>& extras;
  const Eigen::Matrix3d& rotation;
  bool half = true;
  std::array<int, 3> axes{};                ///< where the brick's axes go in its leaf (mask_axes.h)
  std::array<std::uint16_t, 512> voxel_at;  ///< of the brick, for each place of the leaf

  /// `out` may hold those of another brick, whose memory is used again.
  void operator()(const Brick& brick, BrickLeaves& out) const;
};

}  // namespace lamina::volume
