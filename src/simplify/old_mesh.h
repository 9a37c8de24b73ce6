// A piece as it was before contractions, and how far it may be left.
#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "meshes/vec3.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// How far a triangle is from the mesh that simplification began with, at most.
struct Errors {
  float out = 0;   ///< every point of that mesh is within `out` of a triangle
  float back = 0;  ///< every point of the triangle is within `back` of that mesh
};

struct OldMesh {
  OldMesh(std::vector<meshes::Vec3> places, std::vector<Triangle> corners, std::vector<Errors> of_triangles,
          double most)
      : positions(std::move(places)),
        triangles(std::move(corners)),
        errors(std::move(of_triangles)),
        bound((1 - kRounding) * most),
        begins(positions.size() + 1),
        listed(3 * triangles.size()) {
    for (const Triangle& t : triangles) {
      for (const std::uint32_t v : t) ++begins[v];
    }
    std::uint32_t end = 0;
    for (std::uint32_t& begin : begins) begin = end += begin;
    for (std::uint32_t i = 0; i < triangles.size(); ++i) {
      for (const std::uint32_t v : triangles[i]) listed[--begins[v]] = i;
    }
    twins.reserve(listed.size());
    for (std::uint32_t side = 0; side < listed.size(); ++side)
      twins.push_back(find_twin(triangles, side, around(triangles[side / 3][side % 3])));
  }

  /// The triangles at a vertex.
  [[nodiscard]] std::span<const std::uint32_t> around(std::uint32_t vertex) const {
    return {listed.data() + begins[vertex], begins[vertex + 1] - begins[vertex]};
  }

  static constexpr double kRounding = 1e-6;  ///< of the bound: what arithmetic may cost

  std::vector<meshes::Vec3> positions;
  std::vector<Triangle> triangles;
  std::vector<Errors> errors;  ///< of the triangles
  double bound;
  std::vector<std::uint32_t> begins, listed;
  std::vector<std::uint32_t> twins;  ///< of the sides (Overlay): the same one of the other triangle; kNone: a boundary
};

}  // namespace lamina::simplify
