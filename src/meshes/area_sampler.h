// Points on a mesh by area.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"

namespace lamina::meshes {

/// A point of a mesh: triangle and barycentric weights of its corners.
struct SurfacePoint {
  std::uint32_t triangle = 0;
  std::array<double, 3> weights{};
};

/// Area of triangle t of the mesh.
double triangle_area(const TriangleMesh& mesh, std::size_t t);

/// Maps the unit cube to the mesh's surface, uniformly by area. Keeps 12 bytes per triangle.
class AreaSampler {
 public:
  explicit AreaSampler(const TriangleMesh& mesh);
  [[nodiscard]] double total_area() const { return cumulative_.empty() ? 0 : cumulative_.back(); }
  /// u picks the triangle by its share of the area, (v, w) the place in it; all in [0, 1). Wants total_area() > 0.
  [[nodiscard]] SurfacePoint at(double u, double v, double w) const;

 private:
  std::vector<double> cumulative_;    ///< area up to and including each triangle
  std::vector<std::uint32_t> guide_;  ///< first triangle that can hold the area of each of as many equal parts
};

std::array<double, 3> position_at(const TriangleMesh& mesh, const SurfacePoint& p);

}  // namespace lamina::meshes
