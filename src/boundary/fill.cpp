#include "boundary/fill.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>

#include "boundary/gap_surface.h"
#include "meshes/settled_normal.h"

namespace lamina::boundary {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

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

/// Edges of the rim beside which the filling turns over or folds farther than `most`, for each of the rim.
double share_folded(const Rim& rim, const std::vector<Vec3>& points, const std::vector<Vec3>& facing, double most,
                    const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  const auto folded = [most](const Vec3& a, const Vec3& b) {
    const double length = std::sqrt(a.squaredNorm() * b.squaredNorm());
    return !(length > 0) || 1 - a.dot(b) / length > most;
  };
  std::size_t count = 0;
  for (const auto& t : triangles) {
    const Vec3 normal = (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]);
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[k] < rim.size() && t[(k + 1) % 3] == rim.next[t[k]] && folded(normal, facing[t[k]])) ++count;
    }
    if (normal.z() <= 0) ++count;
  }
  return static_cast<double>(count) / static_cast<double>(rim.size());
}

Filling refused(Verdict verdict) {
  Filling filling;
  filling.verdict = verdict;
  return filling;
}

/// Whether each vertex of the rim belongs to the surface around the gap.
std::vector<bool> fitting(const Rim& rim, const Quadric& quadric, double width) {
  const double farthest = std::max(kFarthestFromQuadric * rim.base.radius, kFarthestOfWidth * width);
  std::vector<bool> fits(rim.size());
  for (std::size_t i = 0; i < rim.size(); ++i) {
    const Vec3& p = rim.points[i];
    fits[i] = rim.normals[i].z() >= kLeastNormalCosine && std::abs(p.z() - quadric.height(p.head<2>())) <= farthest;
  }
  return fits;
}

std::optional<std::vector<PlaneTriangle>> triangles_over(const Rim& rim, const std::vector<Vec2>& outline) {
  const auto allowed = [&](std::uint32_t i, std::uint32_t j) { return rim.allows(i, j); };
  if (rim.begins.size() > 1 || rim.size() > kMostPlanned) {
    const auto polygon = polygon_of(rim, outline);
    if (!polygon) return std::nullopt;
    return triangulate_by_ears(outline, *polygon, allowed);
  }
  std::vector<Vec3> corners;
  for (std::uint32_t i = 0; i < rim.size(); ++i)
    corners.emplace_back(outline[i].x(), outline[i].y(), rim.points[i].z());
  // Triangles along a boundary loop may be slivers that face anywhere: vertices' normals say more.
  return triangulate_polygon(corners, rim.normals, allowed);
}

/// The length of edges wanted at each vertex of the rim.
std::vector<double> scale_of(const Rim& rim) {
  std::vector<double> scale(rim.size(), 0);
  for (std::uint32_t i = 0; i < rim.size(); ++i) {
    const double length = (rim.points[rim.next[i]] - rim.points[i]).norm();
    scale[i] += 0.5 * length;
    scale[rim.next[i]] += 0.5 * length;
  }
  return scale;
}

Eigen::MatrixXd attributes_of(const std::vector<const Loop*>& loops, const Rim& rim) {
  const std::size_t count = loops.front()->attributes.size() / loops.front()->vertices.size();
  Eigen::MatrixXd out(rim.size(), static_cast<Eigen::Index>(count));
  Eigen::Index row = 0;
  for (const Loop* loop : loops) {
    for (std::size_t i = 0; i < loop->vertices.size(); ++i, ++row) {
      for (std::size_t a = 0; a < count; ++a)
        out(row, static_cast<Eigen::Index>(a)) = static_cast<double>(loop->attributes[i * count + a]);
    }
  }
  return out;
}

/// Where the rim lies badly to what its normals say, so does the surface that spans it, and its triangles know.
void settle_normals(const Points& points, const Triangles& triangles, GapSurface& gap) {
  const Points around = normals_around(points, triangles);
  const auto as_triple = [](const Vec3& v) { return meshes::Vec3{v.x(), v.y(), v.z()}; };
  const std::size_t rim = points.size() - gap.normals.size();
  for (std::size_t i = 0; i < gap.normals.size(); ++i) {
    const auto settled = meshes::settled_normal(as_triple(gap.normals[i]), meshes::unit(as_triple(around[rim + i])));
    gap.normals[i] = Vec3(settled.data());
  }
}

void append(const GapSurface& gap, const Base& base, Filling& out) {
  for (std::size_t i = 0; i < gap.positions.size(); ++i) {
    const Vec3 position = base.world(gap.positions[i]);
    const Eigen::Vector3f normal = (base.axes.transpose() * gap.normals[i]).cast<float>();
    out.positions.push_back({position.x(), position.y(), position.z()});
    out.normals.push_back({normal.x(), normal.y(), normal.z()});
    for (Eigen::Index a = 0; a < gap.attributes.cols(); ++a)
      out.attributes.push_back(static_cast<float>(gap.attributes(static_cast<Eigen::Index>(i), a)));
  }
}

/// Where one surface goes on all around.
Filling fill_smooth(const std::vector<const Loop*>& loops) {
  const Rim rim(loops, base_of(*loops.front()));
  const double area = signed_area(rim);
  if (area <= 0) return refused(Verdict::outer_boundary);
  const double width = 2 * std::sqrt(area / std::numbers::pi);
  const Quadric quadric(rim, width);
  const std::vector<bool> fits = fitting(rim, quadric, width);
  if (static_cast<double>(std::count(fits.begin(), fits.end(), false)) > kMostUnfit * rim.size())
    return refused(Verdict::bent);
  const auto outline = simple_outline(rim);
  if (!outline) return refused(Verdict::bent);
  auto triangles = triangles_over(rim, *outline);
  if (!triangles) return refused(Verdict::bent);
  Filling filling;
  filling.triangles = std::move(*triangles);
  std::vector<Vec2> plane = *outline;
  std::vector<double> scale = scale_of(rim);
  refine_triangles(plane, scale, filling.triangles, [&](std::uint32_t i, std::uint32_t j) { return rim.allows(i, j); });
  GapSurface gap = span_gap({rim, fits, quadric, attributes_of(loops, rim)}, plane, filling.triangles);
  std::vector<Vec3> points = rim.points;
  points.insert(points.end(), gap.positions.begin(), gap.positions.end());
  if (share_folded(rim, points, rim.normals, kMostFold, filling.triangles) > kMostUnfit) return refused(Verdict::bent);
  settle_normals(points, filling.triangles, gap);
  append(gap, rim.base, filling);
  filling.verdict = Verdict::filled;
  return filling;
}

/// A gap so small that its triangles hardly matter.
Filling fill_small(const Loop& loop) {
  const Rim rim({&loop}, widest_base(loop));
  const auto outline = simple_outline(rim);
  if (!outline || *outline != plane_of(rim)) return refused(Verdict::bent);
  auto triangles =
      triangulate_polygon(rim.points, rim.facing, [&](std::uint32_t i, std::uint32_t j) { return rim.allows(i, j); });
  if (!triangles || share_folded(rim, rim.points, rim.facing, kMostSmallFold, *triangles) > 0)
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
    case Verdict::joined:
      return "joined";
    case Verdict::invented:
      return "invented";
  }
  return "";
}

Filling fill_loop(const Loop& loop, double longest) {
  if (loop.vertices.size() < 3) return refused(Verdict::bent);
  if (is_triangle(loop)) return refused(Verdict::outer_boundary);
  const double length = length_in_radii(loop);
  Filling filling = fill_smooth({&loop});
  // What an outer boundary is does not depend on its length.
  if (filling.verdict != Verdict::outer_boundary && !(length <= longest)) return refused(Verdict::too_long);
  if (filling.verdict == Verdict::filled || length > std::min(longest, kSmallLoop)) return filling;
  Filling small = fill_small(loop);
  return small.verdict == Verdict::filled ? small : filling;
}

Filling fill_around(const Loop& loop, const std::vector<const Loop*>& islands) {
  std::vector<const Loop*> loops{&loop};
  loops.insert(loops.end(), islands.begin(), islands.end());
  return fill_smooth(loops);
}

Filling fill_any(const Loop& loop) {
  const std::size_t n = loop.vertices.size();
  if (n < 3) return refused(Verdict::bent);
  if (is_triangle(loop)) return refused(Verdict::outer_boundary);
  const Base base = widest_base(loop);
  const Rim rim({&loop}, base);
  Filling filling;
  filling.verdict = Verdict::filled;
  if (auto triangles =
          triangulate_by_area(rim.points, [&](std::uint32_t i, std::uint32_t j) { return rim.allows(i, j); })) {
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

FilledPlace::FilledPlace(const Loop& loop, const Filling& filling)
    : base_(widest_base(loop)), triangles_(filling.triangles) {
  for (const BoundaryVertex& v : loop.vertices) points_.push_back(base_.local(to_vec(v.position)));
  for (const Vec3& p : points_) outline_.emplace_back(p.head<2>());
  for (const auto& v : filling.positions) points_.push_back(base_.local(to_vec(v)));
}

bool FilledPlace::holds(const BoundaryVertex& other) const {
  const Vec3 p = base_.local(to_vec(other.position));
  for (const auto& t : triangles_) {
    const Vec3 &a = points_[t[0]], &b = points_[t[1]], &c = points_[t[2]];
    const double u = cross(b.head<2>() - p.head<2>(), c.head<2>() - p.head<2>());
    const double v = cross(c.head<2>() - p.head<2>(), a.head<2>() - p.head<2>());
    const double w = cross(a.head<2>() - p.head<2>(), b.head<2>() - p.head<2>());
    if (u < 0 || v < 0 || w < 0) continue;
    const double height = (u * a.z() + v * b.z() + w * c.z()) / (u + v + w);
    if (std::abs(p.z() - height) < kOccupied * base_.radius) return true;
  }
  return false;
}

bool FilledPlace::surrounds(const Loop& other) const {
  return std::all_of(other.vertices.begin(), other.vertices.end(), [&](const BoundaryVertex& v) {
    return is_inside(base_.local(to_vec(v.position)).head<2>(), outline_);
  });
}

bool lies_beside(const Loop& loop, const Loop& rim) {
  return std::all_of(loop.vertices.begin(), loop.vertices.end(), [&](const BoundaryVertex& v) {
    return std::any_of(rim.vertices.begin(), rim.vertices.end(), [&](const BoundaryVertex& r) {
      return (to_vec(v.position) - to_vec(r.position)).norm() <= kBesideRim * static_cast<double>(r.radius);
    });
  });
}

}  // namespace lamina::boundary
