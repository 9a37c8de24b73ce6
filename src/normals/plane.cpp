#include "normals/plane.h"

#include <algorithm>
#include <cmath>

namespace lamina::normals {
namespace {

using Vector = std::array<double, 3>;

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// The least root of l^3 - t l^2 + s l - d, all of whose roots are real and not negative: Newton's steps from 0 never
/// pass it.
double least_root(double t, double s, double d) {
  double l = 0;
  for (int i = 0; i < 64; ++i) {
    const double value = ((l - t) * l + s) * l - d;
    const double slope = (3 * l - 2 * t) * l + s;
    if (!(value < 0) || !(slope > 0)) break;
    const double next = l - value / slope;
    if (!(next > l)) break;
    l = next;
  }
  return l;
}

}  // namespace

Plane fit_plane(const Moments& m) {
  Plane plane;
  if (m.count < 3) return plane;
  const double n = 1 / m.count;
  const Vector mean{m.sum[0] * n, m.sum[1] * n, m.sum[2] * n};
  double xx = m.products[0] * n - mean[0] * mean[0];
  double xy = m.products[1] * n - mean[0] * mean[1];
  double xz = m.products[2] * n - mean[0] * mean[2];
  double yy = m.products[3] * n - mean[1] * mean[1];
  double yz = m.products[4] * n - mean[1] * mean[2];
  double zz = m.products[5] * n - mean[2] * mean[2];
  const double trace = xx + yy + zz;
  if (!(trace > 0)) return plane;
  // Of trace one: what follows is a matter of ratios.
  const double scale = 1 / trace;
  for (double* v : {&xx, &xy, &xz, &yy, &yz, &zz}) *v *= scale;
  const double s = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz;
  const double d = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  const double least = std::clamp(least_root(1, s, d), 0.0, 1.0 / 3);
  const double sum = 1 - least;  // of the other two
  const double product = std::max(0.0, s - least * sum);
  const double half = 0.5 * sum;
  const double most = half + std::sqrt(std::max(0.0, half * half - product));
  plane.least = least * trace;
  plane.middle = product / most * trace;
  plane.most = most * trace;

  const Vector r0{xx - least, xy, xz};
  const Vector r1{xy, yy - least, yz};
  const Vector r2{xz, yz, zz - least};
  const std::array<Vector, 3> candidates{cross(r0, r1), cross(r0, r2), cross(r1, r2)};
  const Vector* best = candidates.data();
  for (const Vector& c : candidates) {
    if (dot(c, c) > dot(*best, *best)) best = &c;
  }
  const double squared = dot(*best, *best);
  // The rows span a line where the two smaller variances are equal: no plane is the best.
  constexpr double kNone = 1e-18;
  if (!(squared > kNone)) return plane;
  const double inverse = 1 / std::sqrt(squared);
  for (std::size_t a = 0; a < 3; ++a) plane.normal[a] = static_cast<float>((*best)[a] * inverse);
  return plane;
}

}  // namespace lamina::normals
