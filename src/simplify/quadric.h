// Sums of squared distances to planes, as functions of a point.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "meshes/vec3.h"

namespace lamina::simplify {

constexpr double kNormalNoise = 1e-3;  ///< of planes: about what floats leave of a small triangle's normal

/// x' A x - 2 b' x + c with symmetric A, the weighted sum of squared distances of x to planes (Garland and Heckbert
/// 1997).
struct Quadric {
  std::array<double, 6> a{};  ///< xx xy xz yy yz zz
  meshes::Vec3 b{};
  double c = 0;

  Quadric& operator+=(const Quadric& q) {
    for (std::size_t i = 0; i < a.size(); ++i) a[i] += q.a[i];
    b = meshes::operator+(b, q.b);
    c += q.c;
    return *this;
  }
  [[nodiscard]] double at(const meshes::Vec3& x) const {
    const auto& [xx, xy, xz, yy, yz, zz] = a;
    return x[0] * (xx * x[0] + 2 * (xy * x[1] + xz * x[2])) + x[1] * (yy * x[1] + 2 * yz * x[2]) + zz * x[2] * x[2] -
           2 * meshes::dot(b, x) + c;
  }
  /// The same function of points that are counted from elsewhere, d of which is 0 here.
  [[nodiscard]] Quadric moved(const meshes::Vec3& d) const {
    const auto& [xx, xy, xz, yy, yz, zz] = a;
    const meshes::Vec3 ad{xx * d[0] + xy * d[1] + xz * d[2], xy * d[0] + yy * d[1] + yz * d[2],
                          xz * d[0] + yz * d[1] + zz * d[2]};
    Quadric q = *this;
    q.b = meshes::operator+(b, ad);
    q.c = c + 2 * meshes::dot(b, d) + meshes::dot(d, ad);
    return q;
  }
  /// Of all planes.
  [[nodiscard]] double weight() const { return a[0] + a[3] + a[5]; }
  /// Where it is least, by the adjugate of A; nothing where A is too near to singular for that.
  [[nodiscard]] std::optional<meshes::Vec3> least() const {
    const auto& [xx, xy, xz, yy, yz, zz] = a;
    const double cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy;
    const double cyy = xx * zz - xz * xz, cyz = xy * xz - xx * yz, czz = xx * yy - xy * xy;
    const double det = xx * cxx + xy * cxy + xz * cxz;
    const double size = xx + yy + zz;
    if (!(det > 1e-12 * size * size * size)) return std::nullopt;
    const double s = 1 / det;
    return meshes::Vec3{s * (cxx * b[0] + cxy * b[1] + cxz * b[2]), s * (cxy * b[0] + cyy * b[1] + cyz * b[2]),
                        s * (cxz * b[0] + cyz * b[1] + czz * b[2])};
  }
};

/// The plane through p of unit normal n. Its normal is known up to `noise` about p: the expected squared distance
/// (Trettner and Kobbelt 2020), which grows slowly along the plane, too.
inline Quadric plane_quadric(const meshes::Vec3& p, const meshes::Vec3& n, double weight, double noise) {
  const double d = meshes::dot(n, p), s = noise * noise;
  Quadric q;
  q.a = {weight * (n[0] * n[0] + s), weight * n[0] * n[1], weight * n[0] * n[2],
         weight * (n[1] * n[1] + s), weight * n[1] * n[2], weight * (n[2] * n[2] + s)};
  for (std::size_t k = 0; k < 3; ++k) q.b[k] = weight * (d * n[k] + s * p[k]);
  q.c = weight * (d * d + s * meshes::dot(p, p));
  return q;
}

}  // namespace lamina::simplify
