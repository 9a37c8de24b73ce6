#include "boundary/fill.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include <Eigen/Geometry>

#include "boundary/triangulate_polygon.h"

namespace lamina::boundary {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

Vec3 to_vec(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}
Vec3 to_vec(const std::array<float, 3>& v) {
  return {double{v[0]}, double{v[1]}, double{v[2]}};
}

/// A plane through the middle of the boundary loop, across its mean normal.
struct Base {
  Vec3 middle = Vec3::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< rows; the last is the normal
  double radius = 0;                                   ///< mean influence radius
  [[nodiscard]] Vec3 local(const Vec3& p) const { return axes * (p - middle); }
};

void stand_across(const Vec3& normal, Base& base) {
  if (!(normal.norm() > 0)) return;
  const Vec3 up = normal.normalized();
  base.axes.row(2) = up;
  base.axes.row(0) = up.unitOrthogonal();
  base.axes.row(1) = up.cross(Vec3(base.axes.row(0)));
}

Base base_of(const Loop& loop) {
  Base base;
  const std::size_t n = loop.vertices.size();
  Vec3 normal = Vec3::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const BoundaryVertex& v = loop.vertices[i];
    const Vec3 p = to_vec(v.position);
    const double edges = (to_vec(loop.vertices[(i + 1) % n].position) - p).norm() +
                         (p - to_vec(loop.vertices[(i + n - 1) % n].position)).norm();
    base.middle += p / static_cast<double>(n);
    base.radius += static_cast<double>(v.radius) / static_cast<double>(n);
    normal += edges * to_vec(v.normal);
  }
  stand_across(normal, base);
  return base;
}

/// The plane in which the boundary loop encloses most, on the side from which it runs anticlockwise.
Base widest_base(const Loop& loop) {
  Base base = base_of(loop);
  Vec3 area = Vec3::Zero();
  const std::size_t n = loop.vertices.size();
  for (std::size_t i = 0; i < n; ++i) {
    area += (to_vec(loop.vertices[i].position) - base.middle)
                .cross(to_vec(loop.vertices[(i + 1) % n].position) - base.middle);
  }
  stand_across(area, base);
  return base;
}

/// The loop as its base sees it.
struct LocalLoop {
  LocalLoop(const Loop& loop, const Base& seen_from) : base(seen_from), taken(loop.taken.begin(), loop.taken.end()) {
    for (std::size_t i = 0; i < loop.vertices.size(); ++i) {
      points.push_back(base.local(to_vec(loop.vertices[i].position)));
      normals.push_back(base.axes * to_vec(loop.vertices[i].normal));
      facing.push_back(base.axes * to_vec(loop.facing[i]));
    }
  }
  [[nodiscard]] bool allows(std::uint32_t i, std::uint32_t j) const {
    return j >= points.size() || !taken.contains({i, j});
  }
  Base base;
  std::vector<Vec3> points, normals, facing;
  std::set<std::array<std::uint32_t, 2>> taken;
};

double length_in_radii(const Loop& loop) {
  double sum = 0;
  const std::size_t n = loop.vertices.size();
  for (std::size_t i = 0; i < n; ++i) {
    const BoundaryVertex &a = loop.vertices[i], &b = loop.vertices[(i + 1) % n];
    sum += 2 * (to_vec(b.position) - to_vec(a.position)).norm() /
           (static_cast<double>(a.radius) + static_cast<double>(b.radius));
  }
  return sum;
}

/// Algebraic sphere of least squares to points and their normals (Guennebaud and Gross 2007), as a height over a plane.
class Sphere {
 public:
  Sphere(const std::vector<Vec3>& points, const std::vector<Vec3>& normals) {
    double pn = 0, pp = 0;
    Vec3 p = Vec3::Zero(), n = Vec3::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      pn += points[i].dot(normals[i]);
      pp += points[i].squaredNorm();
      p += points[i];
      n += normals[i];
    }
    const double w = static_cast<double>(points.size());
    const double spread = pp - p.squaredNorm() / w;
    quadric_ = spread > 0 ? 0.5 * (pn - p.dot(n) / w) / spread : 0;
    linear_ = (n - 2 * quadric_ * p) / w;
    constant_ = -(linear_.dot(p) + quadric_ * pp) / w;
  }
  [[nodiscard]] double distance(const Vec3& x) const {
    const double slope = gradient(x).norm();
    return slope > 0 ? (constant_ + linear_.dot(x) + quadric_ * x.squaredNorm()) / slope
                     : std::numeric_limits<double>::infinity();
  }
  [[nodiscard]] Vec3 gradient(const Vec3& x) const { return linear_ + 2 * quadric_ * x; }
  /// Where the side that faces up passes over a point of the plane.
  [[nodiscard]] std::optional<double> height(const Vec2& at) const {
    const double c = constant_ + linear_.head<2>().dot(at) + quadric_ * at.squaredNorm();
    const double under = linear_.z() * linear_.z() - 4 * quadric_ * c;
    if (under < 0) return std::nullopt;
    const double slope = linear_.z() + std::sqrt(under);
    if (!(slope > 0)) return std::nullopt;
    return -2 * c / slope;
  }

 private:
  double constant_ = 0, quadric_ = 0;
  Vec3 linear_ = Vec3::Zero();
};

double signed_area(const std::vector<Vec3>& polygon) {
  double sum = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i)
    sum += cross(polygon[i].head<2>(), polygon[(i + 1) % polygon.size()].head<2>());
  return 0.5 * sum;
}

bool segments_meet(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const auto side = [](const Vec2& p, const Vec2& q, const Vec2& r) { return cross(q - p, r - p); };
  return side(a, b, c) * side(a, b, d) <= 0 && side(c, d, a) * side(c, d, b) <= 0;
}

bool is_simple(const std::vector<Vec3>& polygon) {
  const std::size_t n = polygon.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 2; j < n; ++j) {
      if (i == 0 && j == n - 1) continue;
      if (segments_meet(polygon[i].head<2>(), polygon[i + 1].head<2>(), polygon[j].head<2>(),
                        polygon[(j + 1) % n].head<2>()))
        return false;
    }
  }
  return true;
}

/// Weights of the boundary loop's vertices at a point inside: one over the distance squared.
std::vector<double> weights_at(const Vec2& at, const std::vector<Vec3>& outline) {
  std::vector<double> weights;
  double sum = 0;
  for (const Vec3& p : outline) {
    weights.push_back(1 / std::max((p.head<2>() - at).squaredNorm(), 1e-300));
    sum += weights.back();
  }
  for (double& w : weights) w /= sum;
  return weights;
}

bool folds_too_far(const std::vector<Vec3>& points, const std::vector<Vec3>& facing, double most,
                   const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  const auto folded = [most](const Vec3& a, const Vec3& b) {
    const double length = std::sqrt(a.squaredNorm() * b.squaredNorm());
    return !(length > 0) || 1 - a.dot(b) / length > most;
  };
  const auto n = static_cast<std::uint32_t>(facing.size());
  for (const auto& t : triangles) {
    const Vec3 normal = (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]);
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[(k + 1) % 3] == (t[k] + 1) % n && t[k] < n && folded(normal, facing[t[k]])) return true;
    }
    if (normal.z() <= 0) return true;
  }
  return false;
}

/// New vertices on the sphere, bent so that it passes through the boundary loop.
bool place_inner(const Loop& loop, const LocalLoop& local, const Sphere& sphere, const std::vector<Vec2>& plane,
                 std::vector<Vec3>& points, Filling& out) {
  const Base& base = local.base;
  const std::vector<Vec3>& outline = local.points;
  const std::size_t n = outline.size();
  const std::size_t attributes = loop.attributes.size() / n;
  std::vector<double> above(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto height = sphere.height(outline[i].head<2>());
    if (!height) return false;
    above[i] = outline[i].z() - *height;
  }
  for (std::size_t v = n; v < plane.size(); ++v) {
    const auto height = sphere.height(plane[v]);
    if (!height) return false;
    const std::vector<double> weights = weights_at(plane[v], outline);
    double z = *height;
    for (std::size_t i = 0; i < n; ++i) z += weights[i] * above[i];
    const Vec3 point(plane[v].x(), plane[v].y(), z);
    points.push_back(point);
    const Vec3 world = base.middle + base.axes.transpose() * point;
    const Vec3 normal = (base.axes.transpose() * sphere.gradient(point)).normalized();
    out.positions.push_back({world.x(), world.y(), world.z()});
    out.normals.push_back(
        {static_cast<float>(normal.x()), static_cast<float>(normal.y()), static_cast<float>(normal.z())});
    for (std::size_t a = 0; a < attributes; ++a) {
      double value = 0;
      for (std::size_t i = 0; i < n; ++i)
        value += weights[i] * static_cast<double>(loop.attributes[i * attributes + a]);
      out.attributes.push_back(static_cast<float>(value));
    }
  }
  return true;
}

Filling refused(Verdict verdict) {
  Filling filling;
  filling.verdict = verdict;
  return filling;
}

/// Where one surface goes on all around.
Filling fill_smooth(const Loop& loop) {
  const LocalLoop local(loop, base_of(loop));
  const std::size_t n = local.points.size();
  if (signed_area(local.points) <= 0) return refused(Verdict::outer_boundary);
  const Sphere sphere(local.points, local.normals);
  for (std::size_t i = 0; i < n; ++i) {
    if (local.normals[i].z() < kLeastNormalCosine ||
        std::abs(sphere.distance(local.points[i])) > kFarthestFromSphere * local.base.radius ||
        sphere.gradient(local.points[i]).z() <= 0)
      return refused(Verdict::bent);
  }
  if (!is_simple(local.points)) return refused(Verdict::bent);
  const auto allowed = [&](std::uint32_t i, std::uint32_t j) { return local.allows(i, j); };
  // Triangles along a boundary loop may be slivers that face anywhere: vertices' normals say more.
  auto triangles = triangulate_polygon(local.points, local.normals, allowed);
  if (!triangles) return refused(Verdict::bent);
  Filling filling;
  filling.triangles = std::move(*triangles);
  std::vector<Vec2> plane;
  std::vector<double> scale;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& p = local.points[i];
    plane.push_back(p.head<2>());
    scale.push_back(0.5 * ((p - local.points[(i + 1) % n]).norm() + (p - local.points[(i + n - 1) % n]).norm()));
  }
  refine_triangles(plane, scale, filling.triangles, allowed);
  std::vector<Vec3> points = local.points;
  if (!place_inner(loop, local, sphere, plane, points, filling) ||
      folds_too_far(points, local.normals, kMostFold, filling.triangles))
    return refused(Verdict::bent);
  filling.verdict = Verdict::filled;
  return filling;
}

/// A gap so small that its triangles hardly matter.
Filling fill_small(const Loop& loop) {
  const LocalLoop local(loop, widest_base(loop));
  if (!is_simple(local.points)) return refused(Verdict::bent);
  auto triangles = triangulate_polygon(local.points, local.facing,
                                       [&](std::uint32_t i, std::uint32_t j) { return local.allows(i, j); });
  if (!triangles || folds_too_far(local.points, local.facing, kMostSmallFold, *triangles))
    return refused(Verdict::bent);
  Filling filling;
  filling.triangles = std::move(*triangles);
  filling.verdict = Verdict::filled;
  return filling;
}

/// The boundary loop of a lone triangle, whose filling would be its back.
bool is_triangle(const Loop& loop) {
  return loop.vertices.size() == 3 && loop.facing[0] == loop.facing[1] && loop.facing[1] == loop.facing[2] &&
         (to_vec(loop.vertices[1].position) - to_vec(loop.vertices[0].position))
                 .cross(to_vec(loop.vertices[2].position) - to_vec(loop.vertices[0].position))
                 .dot(to_vec(loop.facing[0])) <= 0;
}

}  // namespace

const char* describe(Verdict verdict) {
  switch (verdict) {
    case Verdict::filled:
      return "filled";
    case Verdict::too_long:
      return "long";
    case Verdict::outer_boundary:
      return "outer boundary";
    case Verdict::bent:
      return "bent";
    case Verdict::occupied:
      return "occupied";
  }
  return "";
}

Filling fill_loop(const Loop& loop, double longest) {
  if (loop.vertices.size() < 3) return refused(Verdict::bent);
  if (is_triangle(loop)) return refused(Verdict::outer_boundary);
  const double length = length_in_radii(loop);
  Filling filling = fill_smooth(loop);
  // What an outer boundary is does not depend on its length.
  if (filling.verdict != Verdict::outer_boundary && !(length <= longest)) return refused(Verdict::too_long);
  if (filling.verdict == Verdict::filled || length > std::min(longest, kSmallLoop)) return filling;
  Filling small = fill_small(loop);
  return small.verdict == Verdict::filled ? small : filling;
}

Filling fill_any(const Loop& loop) {
  const std::size_t n = loop.vertices.size();
  if (n < 3) return refused(Verdict::bent);
  if (is_triangle(loop)) return refused(Verdict::outer_boundary);
  const Base base = widest_base(loop);
  const LocalLoop local(loop, base);
  Filling filling;
  filling.verdict = Verdict::filled;
  if (auto triangles =
          triangulate_by_area(local.points, [&](std::uint32_t i, std::uint32_t j) { return local.allows(i, j); })) {
    filling.triangles = std::move(*triangles);
    return filling;
  }
  const auto middle = static_cast<std::uint32_t>(n);
  for (std::uint32_t i = 0; i < middle; ++i) filling.triangles.push_back({i, (i + 1) % middle, middle});
  const Vec3 normal = base.axes.row(2);
  filling.positions.push_back({base.middle.x(), base.middle.y(), base.middle.z()});
  filling.normals.push_back(
      {static_cast<float>(normal.x()), static_cast<float>(normal.y()), static_cast<float>(normal.z())});
  const std::size_t attributes = loop.attributes.size() / n;
  for (std::size_t a = 0; a < attributes; ++a) {
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) sum += static_cast<double>(loop.attributes[i * attributes + a]);
    filling.attributes.push_back(static_cast<float>(sum / static_cast<double>(n)));
  }
  return filling;
}

bool occupies(const BoundaryVertex& other, const Loop& loop, const Filling& filling) {
  const Base base = widest_base(loop);
  const Vec3 p = base.local(to_vec(other.position));
  std::vector<Vec3> points;
  for (const BoundaryVertex& v : loop.vertices) points.push_back(base.local(to_vec(v.position)));
  for (const auto& v : filling.positions) points.push_back(base.local(to_vec(v)));
  for (const auto& t : filling.triangles) {
    const Vec3 &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
    const double u = cross(b.head<2>() - p.head<2>(), c.head<2>() - p.head<2>());
    const double v = cross(c.head<2>() - p.head<2>(), a.head<2>() - p.head<2>());
    const double w = cross(a.head<2>() - p.head<2>(), b.head<2>() - p.head<2>());
    if (u < 0 || v < 0 || w < 0) continue;
    const double height = (u * a.z() + v * b.z() + w * c.z()) / (u + v + w);
    if (std::abs(p.z() - height) < kOccupied * base.radius) return true;
  }
  return false;
}

}  // namespace lamina::boundary
