// A piece as it was before contractions, how far it may be left, and whether a triangle lies near it.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <utility>
#include <vector>

#include "meshes/vec3.h"
#include "simplify/cover.h"
#include "simplify/overlay.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// How far a triangle is from the mesh that simplification began with, at most.
struct Errors {
  float out = 0;   ///< every point of that mesh is within `out` of a triangle
  float back = 0;  ///< every point of the triangle is within `back` of that mesh
};

/// A triangle with what is asked of it together: in one line of the cache.
struct OldTriangle {
  Triangle corners;
  std::array<std::uint32_t, 3>
      twins;  ///< of the sides (Overlay): the same one of the other triangle; kNone: a boundary
  Errors errors;
};

struct OldMesh {
  OldMesh(std::vector<meshes::Vec3> places, const std::vector<Triangle>& corners, const std::vector<Errors>& errors,
          double most)
      : positions(std::move(places)),
        bound((1 - kRounding) * most),
        begins(positions.size() + 1),
        listed(3 * corners.size()) {
    for (const Triangle& t : corners) {
      for (const std::uint32_t v : t) ++begins[v];
    }
    std::uint32_t end = 0;
    for (std::uint32_t& begin : begins) begin = end += begin;
    for (std::uint32_t i = 0; i < corners.size(); ++i) {
      for (const std::uint32_t v : corners[i]) listed[--begins[v]] = i;
    }
    triangles.reserve(corners.size());
    for (std::uint32_t i = 0; i < corners.size(); ++i)
      triangles.push_back({corners[i], {kNone, kNone, kNone}, errors[i]});
    for (std::uint32_t side = 0; side < listed.size(); ++side) {
      std::uint32_t& twin = triangles[side / 3].twins[side % 3];
      if (twin != kNone) continue;
      twin = find_twin(corners, side, around(corners[side / 3][side % 3]));
      if (twin != kNone) triangles[twin / 3].twins[twin % 3] = side;
    }
  }

  /// The triangles at a vertex.
  [[nodiscard]] std::span<const std::uint32_t> around(std::uint32_t vertex) const {
    return {listed.data() + begins[vertex], begins[vertex + 1] - begins[vertex]};
  }

  static constexpr double kRounding = 1e-6;  ///< of the bound: what arithmetic may cost

  std::vector<meshes::Vec3> positions;
  std::vector<OldTriangle> triangles;
  double bound;
  std::vector<std::uint32_t> begins, listed;
};

/// The middle of the vertices, more or less, and how far any of them lies from there.
struct Extent {
  explicit Extent(const OldMesh& old);
  meshes::Vec3 origin{};
  double size = 0;  ///< a bound more
};

class NearOld {
 public:
  using Corners = std::array<meshes::Vec3, 3>;
  using Answer = Overlay::Answer;

  /// Refers to the mesh.
  explicit NearOld(const OldMesh& old);

  /// Asks the overlay alone, and for room for the old triangles' other errors. `begin`: an old triangle not far away;
  /// `most`: of distance and error.
  Answer look(const Corners& triangle, std::uint32_t begin, double most);
  /// The same, and where that is unclear whatever lies around.
  bool prove(const Corners& triangle, std::uint32_t begin, double most);

  /// Of the last one that is near: the sum of distance and error, no less (below 0 where it is only likely); old
  /// triangles that it lies near; one of these in the middle.
  [[nodiscard]] float error() const { return error_; }
  [[nodiscard]] std::span<const std::uint32_t> used() const { return overlay_.used(); }
  [[nodiscard]] std::uint32_t begin() const { return overlay_.begin(); }

 private:
  void search(const Corners& triangle, std::uint32_t begin);
  bool cover(const Corners& triangle, const std::vector<const Facet*>& all, double error, int halvings);
  const Facet* facet(std::uint32_t number);

  const OldMesh& old_;
  Extent extent_;
  Overlay overlay_;
  Cover cover_;
  float error_ = 0;
  std::deque<Facet> made_;             ///< facets asked for
  std::vector<const Facet*> facets_;   ///< of the old triangles; or none yet
  std::vector<const Facet*> found_;    ///< those around
  std::vector<std::uint32_t> queue_;   ///< of a search
  std::vector<std::uint32_t> search_;  ///< of old triangles: the last search that met them
  std::uint32_t searches_ = 0;
};

/// A float that is no less than it.
float no_less_than(double error);

}  // namespace lamina::simplify
