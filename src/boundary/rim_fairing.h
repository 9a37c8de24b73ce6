// Rims made even. A cut follows a field that every vertex has for itself, and where the samples end before the field
// passes its level the rim is that of the cells; either way it winds from edge to edge. Vertices on the boundary move
// towards their neighbours along it and stay in the surface.
#pragma once
#include <array>
#include <cstdint>
#include <deque>
#include <vector>

#include "meshes/fan_hashes.h"
#include "meshes/mesh_slab.h"

namespace lamina {

/// Every step takes away what winds from one edge to the next, and half of what takes four edges; corners of a rim lose
/// about an edge.
inline constexpr int kFairingSteps = 4;

/// A vertex moves in a step by no more than this share of the least height of the triangles at it, which keep their
/// side so. (Cuts leave narrow ones.)
inline constexpr double kMostFairing = 0.35;

/// Takes a streamed mesh slab by slab and gives it back, kFairingSteps slabs later: vertices on the boundary with one
/// neighbour to either side along it have gone half of the way to the middle between these, kFairingSteps times, across
/// the normals of the triangles there. What comes out of a slab depends on it and on kFairingSteps slabs to either side
/// alone, and not on the order of triangles.
class RimFairer {
 public:
  void push(MeshSlab slab);
  void finish();  ///< no more slabs come
  /// The next slab, false when none is ready.
  bool pop(MeshSlab& out);

 private:
  using Point = std::array<double, 3>;
  /// A vertex on the boundary.
  struct RimVertex {
    std::uint32_t vertex = 0;                       ///< of its slab
    std::array<std::uint32_t, 2> beside{};          ///< along the boundary, numbers over all slabs
    std::array<Point, kFairingSteps + 1> at{};      ///< before the steps and after each
    std::vector<std::array<std::uint32_t, 2>> fan;  ///< the other two vertices of its triangles, ascending
  };
  /// The triangles at a vertex.
  struct Fan {
    Point normal;         ///< their mean, by area; 0 where they have none
    double least_height;  ///< over a longest side
  };
  struct Held {
    MeshSlab mesh;
    std::uint32_t first = 0;     ///< number of its first vertex
    FanHashes fans;              ///< until the rim is known
    std::vector<RimVertex> rim;  ///< ascending
    int steps = -1;              ///< done; -1: the rim is not known
  };

  void find_rim(Held& here, const Held* above);
  void go_on();
  void step(Held& here, std::size_t number);
  [[nodiscard]] Point position(std::uint32_t v, std::size_t steps) const;
  [[nodiscard]] Fan fan_of(const RimVertex& v, std::size_t steps) const;

  std::deque<Held> held_;  ///< the last that has gone, its positions alone, and those that have not
  bool below_ = false;     ///< the first one held has gone
  bool finished_ = false;
  std::uint32_t pushed_ = 0;  ///< vertices
};

}  // namespace lamina
