// Sums of squared distances to planes, as functions of a point; vertices with such sums, and where an edge goes to by
// them.
#pragma once
#include <algorithm>
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

struct Placed {
  meshes::Vec3 at;
  double cost;  ///< at least 0
};

/// Where the edge from a to b goes, of which `sum` is the quadric of both ends: where that is least, or, where this is
/// nowhere or far off, to an end or the middle.
inline Placed place_edge(const Quadric& sum, const meshes::Vec3& a, const meshes::Vec3& b) {
  using namespace meshes;
  const meshes::Vec3 middle = 0.5 * (a + b), edge = b - a;
  if (const auto least = sum.least()) {
    const meshes::Vec3 off = *least - middle;
    if (dot(off, off) < 4 * dot(edge, edge)) return {*least, std::max(0.0, sum.at(*least))};
  }
  const double at_a = sum.at(a), at_b = sum.at(b), at_middle = sum.at(middle);
  if (at_middle <= at_a && at_middle <= at_b) return {middle, std::max(0.0, at_middle)};
  return at_a <= at_b ? Placed{a, std::max(0.0, at_a)} : Placed{b, std::max(0.0, at_b)};
}

/// How far along the edge from a to b a place is: 0 at a, 1 at b.
inline double share_along(const meshes::Vec3& a, const meshes::Vec3& b, const meshes::Vec3& place) {
  using namespace meshes;
  const meshes::Vec3 edge = b - a;
  const double length2 = dot(edge, edge);
  return length2 > 0 ? std::clamp(dot(place - a, edge) / length2, 0.0, 1.0) : 0.5;
}

/// A vertex with its quadric, of points less its own place, in floats: there planes that a mesh goes through lose no
/// digits, and all of it is a line of the cache.
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
