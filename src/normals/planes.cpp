#include "normals/planes.h"

#include <algorithm>
#include <cmath>

#include "meshes/vec3.h"

namespace lamina::normals {
namespace {

using meshes::cross;
using meshes::dot;
using meshes::Vec3;

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
  const Vec3 mean{m.sum[0] * n, m.sum[1] * n, m.sum[2] * n};
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

  const Vec3 r0{xx - least, xy, xz};
  const Vec3 r1{xy, yy - least, yz};
  const Vec3 r2{xz, yz, zz - least};
  const std::array<Vec3, 3> candidates{cross(r0, r1), cross(r0, r2), cross(r1, r2)};
  const Vec3* best = candidates.data();
  for (const Vec3& c : candidates) {
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

inline void FourMoments::add(const std::array<FourFloats, 3>& d, const FourFloats& weight) {
  const FourFloats x = weight * d[0];
  const FourFloats y = weight * d[1];
  const FourFloats z = weight * d[2];
  count += weight;
  sum[0] += x;
  sum[1] += y;
  sum[2] += z;
  products[0] += x * d[0];
  products[1] += x * d[1];
  products[2] += x * d[2];
  products[3] += y * d[1];
  products[4] += y * d[2];
  products[5] += z * d[2];
}

Moments FourMoments::total() const {
  const auto all = [](const FourFloats& v) { return double{sum_of(v)}; };
  Moments m;
  m.count = all(count);
  std::transform(sum.begin(), sum.end(), m.sum.begin(), all);
  std::transform(products.begin(), products.end(), m.products.begin(), all);
  return m;
}

Moments BallMoments::grow_to(float squared) {
  tree_.fours_within({place_, squared_, squared}, [&](const SampleTree::FourSamples& four) {
    constexpr FourFloats kOne{1, 1, 1, 1};
    sums_.add(four.offset, where((four.squared > squared_) & (four.squared <= squared), kOne));
  });
  squared_ = squared;
  return sums_.total();
}

Plane plane_within(const SampleTree& tree, std::uint32_t place, float squared) {
  const float inverse = 1 / squared;
  FourMoments sums;
  tree.fours_within({place, -1, squared}, [&](const SampleTree::FourSamples& four) {
    sums.add(four.offset, where(four.squared <= squared, 1 - four.squared * inverse));
  });
  return fit_plane(sums.total());
}

}  // namespace lamina::normals
