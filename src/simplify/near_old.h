// Whether a triangle lies near the mesh as it was.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "meshes/vec3.h"
#include "simplify/cover.h"
#include "simplify/old_mesh.h"
#include "simplify/overlay.h"

namespace lamina::simplify {

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
