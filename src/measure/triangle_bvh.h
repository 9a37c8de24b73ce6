// Bounding volume hierarchy over a mesh's triangles: exact distance to the nearest one, and the first hit along a ray.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/vec3.h"

namespace lamina::measure {

/// Squared distance from p to the triangle a b c. A triangle of no area (an angle below 1e-12, where its normal would
/// be rounding noise) is the segments of its sides.
double squared_distance_to_triangle(const meshes::Vec3& p, const meshes::Vec3& a, const meshes::Vec3& b,
                                    const meshes::Vec3& c);

struct Bounds {
  meshes::Vec3 low{}, high{};
};
void widen(Bounds& bounds, const meshes::Vec3& p);
/// Box of the vertices that triangles name. Wants at least one triangle.
Bounds triangle_bounds(const TriangleMesh& mesh);

struct RayHit {
  double distance = 0;  ///< along the unit direction
  std::uint32_t triangle = 0;
  std::array<double, 3> weights{};  ///< barycentric
};

struct NearestTriangle {
  double distance = 0;
  std::uint32_t triangle = 0;
};

/// Holds a reference to the mesh: it must outlive the tree. Queries may run on any number of threads.
/// About 20 bytes per triangle.
class TriangleBvh {
 public:
  /// Wants at least one triangle and finite vertices.
  explicit TriangleBvh(const TriangleMesh& mesh);

  /// Exact distance from p to the nearest triangle.
  [[nodiscard]] double distance(const meshes::Vec3& p) const { return nearest(p).distance; }
  /// The nearest triangle; of equally near ones always the same. `bound` speeds the search up: no less than the
  /// distance, which the caller knows from elsewhere.
  [[nodiscard]] NearestTriangle nearest(const meshes::Vec3& p,
                                        double bound = std::numeric_limits<double>::infinity()) const;
  /// Nearest triangle hit by origin + t * direction, t > 0, from either side. `direction` is a unit vector.
  [[nodiscard]] std::optional<RayHit> first_hit(const meshes::Vec3& origin, const meshes::Vec3& direction) const;

 private:
  struct Box {
    std::array<float, 3> low, high;
  };
  struct Node {
    Box box;                  ///< relative to centre_, rounded outwards
    std::uint32_t first = 0;  ///< leaf: first of its triangles in order_; inner: left child, the right one follows it
    std::uint32_t count = 0;  ///< triangles of a leaf, 0 for inner nodes
  };
  struct Builder;

  [[nodiscard]] static double squared_distance_to_box(const meshes::Vec3& p, const Box& box);
  [[nodiscard]] static std::optional<double> entry(const meshes::Vec3& origin, const meshes::Vec3& inverse,
                                                   const Box& box);

  const TriangleMesh& mesh_;
  meshes::Vec3 centre_{};
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace lamina::measure
