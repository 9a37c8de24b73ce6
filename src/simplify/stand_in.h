// A vertex with the sum of squared distances to the planes it stands for, in the form that passes over a mesh work
// with.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>

#include "meshes/vec3.h"
#include "simplify/quadric.h"

namespace lamina::simplify {

/// The sum is a quadric of points less its own place, in floats: there planes that a mesh goes through lose no digits,
/// and all of it is a line of the cache.
struct alignas(64) StandIn {
  meshes::Vec3 at{};
  std::array<float, 6> a{};  ///< of Quadric
  std::array<float, 3> b{};
  float c = 0;

  /// Of another one at the same place.
  StandIn& operator+=(const StandIn& o) {
    for (std::size_t i = 0; i < a.size(); ++i) a[i] += o.a[i];
    for (std::size_t k = 0; k < b.size(); ++k) b[k] += o.b[k];
    c += o.c;
    return *this;
  }
  /// A plane of unit normal n through its place, as plane_quadric().
  void add_plane(const meshes::Vec3& n, double weight) {
    constexpr double kNoise2 = kNormalNoise * kNormalNoise;
    const auto add = [&](std::size_t i, double value) { a[i] += static_cast<float>(weight * value); };
    add(0, n[0] * n[0] + kNoise2);
    add(1, n[0] * n[1]);
    add(2, n[0] * n[2]);
    add(3, n[1] * n[1] + kNoise2);
    add(4, n[1] * n[2]);
    add(5, n[2] * n[2] + kNoise2);
  }
};

/// The quadric of both, of points less u's place.
inline Quadric sum_of(const StandIn& u, const StandIn& v) {
  using namespace meshes;
  const auto wide = [](const StandIn& from) {
    Quadric q;
    for (std::size_t i = 0; i < q.a.size(); ++i) q.a[i] = static_cast<double>(from.a[i]);
    q.b = to_double(from.b);
    q.c = static_cast<double>(from.c);
    return q;
  };
  Quadric sum = wide(v).moved(v.at - u.at);
  sum += wide(u);
  return sum;
}

/// What stands for `sum`, of points less `origin`, at that place from there.
inline StandIn stand_in(const Quadric& sum, const meshes::Vec3& origin, const meshes::Vec3& place) {
  using namespace meshes;
  const Quadric about = sum.moved(-1 * place);
  StandIn made;
  made.at = origin + place;
  for (std::size_t i = 0; i < made.a.size(); ++i) made.a[i] = static_cast<float>(about.a[i]);
  made.b = to_float(about.b);
  made.c = static_cast<float>(std::max(0.0, about.c));
  return made;
}

/// The least sum that a point on the line through both has: no less than the least of all points, seldom twice as much,
/// and a fraction of the work.
inline float cost_on_line(const StandIn& u, const StandIn& v) {
  const std::array<float, 3> d = meshes::to_float(meshes::operator-(v.at, u.at));
  const auto along = [&](const StandIn& s) {
    return d[0] * (s.a[0] * d[0] + 2 * (s.a[1] * d[1] + s.a[2] * d[2])) + d[1] * (s.a[3] * d[1] + 2 * s.a[4] * d[2]) +
           d[2] * s.a[5] * d[2];
  };
  const auto slope = [&](const StandIn& s) { return s.b[0] * d[0] + s.b[1] * d[1] + s.b[2] * d[2]; };
  // With t from u to v it is c + t^2 p - 2 t e + (1 - t)^2 q + 2 (1 - t) g.
  const float p = along(u), q = along(v), e = slope(u), g = slope(v);
  const float scale = 1 / std::max(p + q, 1e-37F);
  const float of_u = p * scale, of_v = q * scale, turn = e + g;
  return std::max(0.0F, u.c + v.c + p * of_v + 2 * (g * of_u - e * of_v) - turn * (turn * scale));
}

}  // namespace lamina::simplify
