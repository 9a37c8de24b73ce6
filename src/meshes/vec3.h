// Arithmetic on the mesh's own coordinate triples, and what triangles say of a surface: areas, normals, and points on
// it by area.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"

namespace lamina::meshes {

using Vec3 = std::array<double, 3>;

inline Vec3 operator+(const Vec3& a, const Vec3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
inline Vec3 operator-(const Vec3& a, const Vec3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Vec3 operator*(double s, const Vec3& a) {
  return {s * a[0], s * a[1], s * a[2]};
}
inline double dot(const Vec3& a, const Vec3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double norm(const Vec3& a) {
  return std::sqrt(dot(a, a));
}
/// Across the triangle of these corners, anticlockwise as seen from its end; as long as twice the area.
inline Vec3 area_normal(const Vec3& a, const Vec3& b, const Vec3& c) {
  return cross(b - a, c - a);
}
inline double triangle_area(const Vec3& a, const Vec3& b, const Vec3& c) {
  return 0.5 * norm(area_normal(a, b, c));
}
/// a of length one; zero stays zero.
inline Vec3 unit(const Vec3& a) {
  const double n = norm(a);
  return n > 0 ? (1 / n) * a : a;
}
inline Vec3 to_double(const std::array<float, 3>& a) {
  return {a[0], a[1], a[2]};
}
inline std::array<float, 3> to_float(const Vec3& a) {
  return {static_cast<float>(a[0]), static_cast<float>(a[1]), static_cast<float>(a[2])};
}

/// Across triangle t of the mesh, as long as twice its area.
inline Vec3 area_normal(const TriangleMesh& mesh, std::size_t t) {
  const auto& c = mesh.triangles[t];
  return area_normal(mesh.positions[c[0]], mesh.positions[c[1]], mesh.positions[c[2]]);
}

/// Area of triangle t of the mesh.
inline double triangle_area(const TriangleMesh& mesh, std::size_t t) {
  return 0.5 * norm(area_normal(mesh, t));
}

/// Unit normals by area-weighted sums of the triangles around each vertex; 0 0 0 where these say nothing.
inline std::vector<std::array<float, 3>> vertex_normals(const TriangleMesh& mesh) {
  std::vector<Vec3> sums(mesh.positions.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vec3 n = area_normal(mesh, t);
    if (!std::isfinite(n[0]) || !std::isfinite(n[1]) || !std::isfinite(n[2])) continue;
    for (const std::uint32_t v : mesh.triangles[t]) sums[v] = sums[v] + n;
  }
  std::vector<std::array<float, 3>> normals(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) normals[i] = to_float(unit(sums[i]));
  return normals;
}

/// A point of a mesh: triangle and barycentric weights of its corners.
struct SurfacePoint {
  std::uint32_t triangle = 0;
  std::array<double, 3> weights{};
};

inline Vec3 position_at(const TriangleMesh& mesh, const SurfacePoint& p) {
  const auto& c = mesh.triangles[p.triangle];
  return p.weights[0] * mesh.positions[c[0]] + p.weights[1] * mesh.positions[c[1]] +
         p.weights[2] * mesh.positions[c[2]];
}

/// Maps the unit cube to the mesh's surface, uniformly by area. Keeps 12 bytes per triangle.
class AreaSampler {
 public:
  explicit AreaSampler(const TriangleMesh& mesh) : cumulative_(mesh.triangles.size()), guide_(mesh.triangles.size()) {
    double sum = 0;
    for (std::size_t t = 0; t < cumulative_.size(); ++t) cumulative_[t] = sum += triangle_area(mesh, t);
    const double part = sum / static_cast<double>(guide_.size());
    std::uint32_t t = 0;
    for (std::size_t g = 0; g < guide_.size(); ++g) {
      while (t + 1 < cumulative_.size() && cumulative_[t] <= part * static_cast<double>(g)) ++t;
      guide_[g] = t;
    }
  }

  [[nodiscard]] double total_area() const { return cumulative_.empty() ? 0 : cumulative_.back(); }

  /// u picks the triangle by its share of the area, (v, w) the place in it; all in [0, 1). Wants total_area() > 0.
  [[nodiscard]] SurfacePoint at(double u, double v, double w) const {
    const double area = u * total_area();
    const auto last = static_cast<std::uint32_t>(cumulative_.size() - 1);
    std::uint32_t t =
        guide_[std::min(static_cast<std::size_t>(u * static_cast<double>(guide_.size())), guide_.size() - 1)];
    while (t > 0 && cumulative_[t - 1] > area) --t;
    while (t < last && cumulative_[t] <= area) ++t;
    // Square-root map of the unit square to the triangle (Turk, Graphics Gems 1990).
    const double s = std::sqrt(v);
    return {t, {1 - s, s * (1 - w), s * w}};
  }

 private:
  std::vector<double> cumulative_;    ///< area up to and including each triangle
  std::vector<std::uint32_t> guide_;  ///< first triangle that can hold the area of each of as many equal parts
};

}  // namespace lamina::meshes
