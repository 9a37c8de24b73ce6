// From bricks of the band to the leaves of the grids: their index space, what they hold, and the leaves' bytes.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/frame.h"
#include "lattice/lattice.h"
#include "levelset/band.h"
#include "vdb/grids.h"
#include "vdb/packed_leaf.h"

namespace lamina::volume {

/// From the lattice of a run to the index space of its grids: these have the input's axes where the frame only permutes
/// them, else the frame's.
struct GridFrame {
  std::array<int, 3> axis_of{0, 1, 2};  ///< index axis of each lattice axis
  openvdb::math::Transform::Ptr transform;
  double voxel = 1;  ///< world units

  GridFrame(const Frame& frame, const Lattice& lattice, int level);
  [[nodiscard]] openvdb::Coord index(const Cell& c) const {
    openvdb::Coord out;
    out[axis_of[0]] = c.x;
    out[axis_of[1]] = c.y;
    out[axis_of[2]] = c.z;
    return out;
  }
};

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

class LeafMaker {
 public:
  /// `rotation`: of the frame.
  LeafMaker(const Band& band, const GridFrame& grid, const std::vector<ExtraGrid>& extras,
            const Eigen::Matrix3d& rotation, bool half);
  /// `out` may hold those of another brick, whose memory is used again.
  void operator()(const Brick& brick, BrickLeaves& out) const;

 private:
  /// Voxels of a brick in their leaf's order.
  using Order = std::span<const std::uint16_t>;
  void fill_scalars(const Brick& brick, const ExtraGrid& extra, Order order, float* values) const;
  void fill_vectors(const Brick& brick, const ExtraGrid& extra, Order order, float* values) const;

  const Band& band_;
  const GridFrame& grid_;
  const std::vector<ExtraGrid>& extras_;
  const Eigen::Matrix3d& rotation_;
  bool half_;
  std::array<int, 3> axes_{};                ///< where the brick's axes go in its leaf (with_axes())
  std::array<std::uint16_t, 512> voxel_at_;  ///< of the brick, for each place of the leaf
};

}  // namespace lamina::volume
