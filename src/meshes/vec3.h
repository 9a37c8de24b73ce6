// Arithmetic on the mesh's own coordinate triples.
#pragma once
#include <array>
#include <cmath>

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

}  // namespace lamina::meshes
