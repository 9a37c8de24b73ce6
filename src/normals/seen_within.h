// How much of a closed surface could have been scanned from a few places inside: nearly all of a room, but less of a
// thing with limbs, holes or folds.
#pragma once
#include <vector>

#include "meshes/vec3.h"
#include "normals/occupancy.h"

namespace lamina::normals {

/// A patch, as it would face if it had been seen from within.
struct Wall {
  meshes::Vec3 at{};  ///< Occupancy::place()
  meshes::Vec3 facing{};
  double area = 0;
};

/// The share of the area that four places see together. 0 for so few walls that cubes are too coarse a picture.
double share_seen_within(const Occupancy& around, const std::vector<Wall>& walls);

}  // namespace lamina::normals
