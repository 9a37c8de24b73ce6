// From the lattice of a run to the index space of its grids.
#pragma once

#include <array>

#include "lamina/frame.h"
#include "lattice/lattice.h"
#include "vdb/grids.h"

namespace lamina::volume {

/// Grids have the input's axes where the frame only permutes them, else the frame's.
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

}  // namespace lamina::volume
