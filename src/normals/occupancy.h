// Where patches are, in cubes, and how far one can look between them.
#pragma once
#include <array>
#include <cstddef>
#include <vector>

#include "meshes/vec3.h"
#include "normals/patch_graph.h"

namespace lamina::normals {

class Occupancy {
 public:
  /// What lies nearer to a patch than so many cubes may be its own surface.
  static constexpr double kClear = 1.8;

  /// Cubes have the size of the graph's cells, or more where these would be too many. Patches of a few samples are
  /// strays that hide nothing. Empty where the cells have no size.
  explicit Occupancy(const PatchGraph& graph);

  [[nodiscard]] bool empty() const { return taken_.empty(); }
  [[nodiscard]] double diagonal() const { return diagonal_; }  ///< of the cloud, cubes
  /// In cubes from the corner.
  [[nodiscard]] meshes::Vec3 place(const PatchNode& node) const;
  /// How many cubes one can look from a place until one that is taken; far more than the diagonal where none is.
  [[nodiscard]] double way(const meshes::Vec3& at, const meshes::Vec3& direction) const;

 private:
  using Cube = std::array<std::ptrdiff_t, 3>;
  [[nodiscard]] std::size_t index(const Cube& cube) const {
    return static_cast<std::size_t>((cube[2] * size_[1] + cube[1]) * size_[0] + cube[0]);
  }

  meshes::Vec3 origin_{};
  double side_ = 1;
  double diagonal_ = 1;
  Cube size_{};
  std::vector<bool> taken_;
};

}  // namespace lamina::normals
