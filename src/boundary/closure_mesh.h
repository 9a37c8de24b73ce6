// The triangles of an invented closure: a disc within a closed polygon in space, no chord of the polygon in it.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace lamina::boundary {

/// Edges grow by this much for each length of distance from the rim.
inline constexpr double kClosureGrading = 0.4;
/// Edges are split and contracted beyond these multiples of the length wanted.
inline constexpr double kLongestEdge = 1.4;
inline constexpr double kShortestEdge = 0.6;

using Points = std::vector<Eigen::Vector3d>;
using Triangles = std::vector<std::array<std::uint32_t, 3>>;

/// Of `points` the first `rim` are the polygon's, in its order; every other one is new.
struct Disc {
  std::size_t rim = 0;
  Points points;
  Triangles triangles;
};

/// Rings of ever fewer vertices around one in the middle. The new vertices have no places yet.
Disc nested_rings(const Points& polygon);

/// Long edges are split, short ones contracted, and edges flipped to Delaunay's, until they are about as long as the
/// rim's beside them, longer ones farther inside. Never joins two vertices of the rim.
void make_even(Disc& disc);

}  // namespace lamina::boundary
