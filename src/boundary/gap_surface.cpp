#include "boundary/gap_surface.h"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>

#include <algorithm>
#include <cmath>
#include <map>

#include "lamina/error.h"

namespace lamina::boundary {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

/// What chance adds to a rim is gone after so many passes over neighbours, and as many over those two, and four edges
/// away where it has so many edges for each: supports of noisy samples are dozens of edges wide. What winds still does
/// so at large.
constexpr int kMostSmoothing = 20;
constexpr std::uint32_t kWidestStride = 4;
constexpr std::uint32_t kEdgesPerStride = 64;

void stand_across(const Vec3& normal, Base& base) {
  if (!(normal.norm() > 0)) return;
  const Vec3 up = normal.normalized();
  base.axes.row(2) = up;
  base.axes.row(0) = up.unitOrthogonal();
  base.axes.row(1) = up.cross(Vec3(base.axes.row(0)));
}

bool segments_meet(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const auto side = [](const Vec2& p, const Vec2& q, const Vec2& r) { return cross(q - p, r - p); };
  return side(a, b, c) * side(a, b, d) <= 0 && side(c, d, a) * side(c, d, b) <= 0;
}

/// Whether the edge meets one of the rim's that begins at `first` or later, those that share a vertex left out.
bool meets_rim(std::uint32_t from, std::uint32_t to, const Rim& rim, const std::vector<Vec2>& at, std::uint32_t first) {
  for (std::uint32_t i = first; i < rim.size(); ++i) {
    const std::uint32_t j = rim.next[i];
    if (i == from || i == to || j == from || j == to) continue;
    if (segments_meet(at[from], at[to], at[i], at[j])) return true;
  }
  return false;
}

bool is_simple(const Rim& rim, const std::vector<Vec2>& at) {
  for (std::uint32_t i = 0; i < rim.size(); ++i) {
    if (meets_rim(i, rim.next[i], rim, at, i + 1)) return false;
  }
  return true;
}

/// A polygon's corner and an island's vertex that see each other.
struct Bridge {
  std::size_t corner = 0;  ///< place in the polygon
  std::uint32_t vertex = 0;
};

/// The shortest edge from the polygon to an island, past all rims.
std::optional<Bridge> bridge_to(std::uint32_t begin, std::uint32_t end, const std::vector<std::uint32_t>& polygon,
                                const Rim& rim, const std::vector<Vec2>& outline) {
  struct Candidate {
    double squared;
    Bridge bridge;
  };
  std::vector<Candidate> candidates;
  for (std::size_t c = 0; c < polygon.size(); ++c) {
    // Where a bridge ends already, two corners lie in one place, which see different sides.
    if (std::count(polygon.begin(), polygon.end(), polygon[c]) > 1) continue;
    for (std::uint32_t v = begin; v < end; ++v)
      candidates.push_back({(outline[v] - outline[polygon[c]]).squaredNorm(), {c, v}});
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.squared < b.squared; });
  for (const Candidate& c : candidates) {
    const std::uint32_t from = polygon[c.bridge.corner], to = c.bridge.vertex;
    if (rim.allows(from, to) && !meets_rim(from, to, rim, outline, 0)) return c.bridge;
  }
  return std::nullopt;
}

}  // namespace

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

Rim::Rim(const std::vector<const Loop*>& loops, const Base& seen_from) : base(seen_from) {
  std::map<Number, std::uint32_t> places;
  for (const Loop* loop : loops) {
    const auto first = size();
    const auto n = static_cast<std::uint32_t>(loop->vertices.size());
    begins.push_back(first);
    for (std::uint32_t i = 0; i < n; ++i) {
      places[loop->vertices[i].number] = first + i;
      points.push_back(base.local(to_vec(loop->vertices[i].position)));
      normals.push_back(base.axes * to_vec(loop->vertices[i].normal));
      facing.push_back(base.axes * to_vec(loop->facing[i]));
      next.push_back(first + (i + 1) % n);
    }
    for (const auto& [i, j] : loop->taken) taken.insert({first + i, first + j});
  }
  for (std::size_t l = 0; l < loops.size(); ++l) {
    for (const auto& [i, number] : loops[l]->leaving) {
      const auto other = places.find(number);
      if (other != places.end())
        taken.insert({std::min(begins[l] + i, other->second), std::max(begins[l] + i, other->second)});
    }
  }
}

bool Rim::allows(std::uint32_t i, std::uint32_t j) const {
  if (std::max(i, j) >= size()) return true;
  return !taken.contains({std::min(i, j), std::max(i, j)});
}

double signed_area(const Rim& rim) {
  double sum = 0;
  const std::uint32_t end = rim.begins.size() > 1 ? rim.begins[1] : rim.size();
  for (std::uint32_t i = 0; i < end; ++i) sum += cross(rim.points[i].head<2>(), rim.points[rim.next[i]].head<2>());
  return 0.5 * sum;
}

std::vector<Vec2> plane_of(const Rim& rim) {
  std::vector<Vec2> plane;
  for (const Vec3& p : rim.points) plane.emplace_back(p.head<2>());
  return plane;
}

std::optional<std::vector<Vec2>> simple_outline(const Rim& rim) {
  std::vector<Vec2> outline = plane_of(rim);
  if (is_simple(rim, outline)) return outline;
  std::vector<std::uint32_t> ahead = rim.next;
  for (std::uint32_t stride = 1; stride <= kWidestStride; stride *= 2) {
    if (stride > 1 && rim.size() < kEdgesPerStride * stride) break;
    for (int pass = 0; pass < kMostSmoothing; ++pass) {
      std::vector<Vec2> smooth(outline.size(), Vec2::Zero());
      for (std::uint32_t i = 0; i < rim.size(); ++i) {
        const std::uint32_t j = ahead[i];
        smooth[i] += 0.25 * (outline[i] + outline[j]);
        smooth[j] += 0.25 * (outline[i] + outline[j]);
      }
      outline = std::move(smooth);
      if (is_simple(rim, outline)) return outline;
    }
    const std::vector<std::uint32_t> once = ahead;
    for (std::uint32_t& j : ahead) j = once[j];
  }
  return std::nullopt;
}

std::optional<std::vector<std::uint32_t>> polygon_of(const Rim& rim, const std::vector<Vec2>& outline) {
  std::vector<std::uint32_t> polygon;
  for (std::size_t loop = 0; loop < rim.begins.size(); ++loop) {
    const std::uint32_t begin = rim.begins[loop];
    const std::uint32_t end = loop + 1 < rim.begins.size() ? rim.begins[loop + 1] : rim.size();
    if (loop == 0) {
      for (std::uint32_t i = begin; i < end; ++i) polygon.push_back(i);
      continue;
    }
    const auto bridge = bridge_to(begin, end, polygon, rim, outline);
    if (!bridge) return std::nullopt;
    std::vector<std::uint32_t> detour;
    std::uint32_t at = bridge->vertex;
    do {
      detour.push_back(at);
      at = rim.next[at];
    } while (at != bridge->vertex);
    detour.push_back(bridge->vertex);
    detour.push_back(polygon[bridge->corner]);
    polygon.insert(polygon.begin() + static_cast<std::ptrdiff_t>(bridge->corner) + 1, detour.begin(), detour.end());
  }
  return polygon;
}

bool is_inside(const Vec2& point, const std::vector<Vec2>& loop) {
  bool inside = false;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Vec2 &a = loop[i], &b = loop[(i + 1) % loop.size()];
    if ((a.y() > point.y()) == (b.y() > point.y())) continue;
    if (point.x() < a.x() + (point.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x())) inside = !inside;
  }
  return inside;
}

namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

/// Cotangents of slivers are kept from weighing more than a thousand fair ones.
constexpr double kMostCotangent = 1e3;
/// Slopes of a rim are averaged over about three of its edges either way, an influence radius.
constexpr int kSlopeSmoothing = 4;

/// Cotangent of the angle at `a`.
double cotangent(const Vec2& a, const Vec2& b, const Vec2& c) {
  const double area = cross(b - a, c - a);
  const double along = (b - a).dot(c - a);
  if (!(area > 0)) return along > 0 ? kMostCotangent : -kMostCotangent;
  return std::clamp(along / area, -kMostCotangent, kMostCotangent);
}

/// The Laplacian of a triangulation, its rows those of the new vertices: over themselves and over the rim.
struct Laplacian {
  Laplacian(std::size_t rim, const std::vector<Vec2>& plane, const std::vector<PlaneTriangle>& triangles)
      : inner(static_cast<Eigen::Index>(plane.size() - rim), static_cast<Eigen::Index>(plane.size() - rim)),
        outer(inner.rows(), static_cast<Eigen::Index>(rim)) {
    std::vector<Eigen::Triplet<double>> own, others;
    const auto at = [rim](std::uint32_t v) { return static_cast<int>(v) - static_cast<int>(rim); };
    const auto add = [&](std::uint32_t v, std::uint32_t w, double weight) {
      if (at(v) < 0) return;
      own.emplace_back(at(v), at(v), weight);
      if (at(w) < 0) {
        others.emplace_back(at(v), static_cast<int>(w), weight);
      } else {
        own.emplace_back(at(v), at(w), -weight);
      }
    };
    for (const PlaneTriangle& t : triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
        const double weight = 0.5 * cotangent(plane[a], plane[b], plane[c]);
        add(b, c, weight);
        add(c, b, weight);
      }
    }
    inner.setFromTriplets(own.begin(), own.end());
    outer.setFromTriplets(others.begin(), others.end());
    solver.compute(inner);
    if (solver.info() != Eigen::Success) throw Error(ExitCode::internal, "a gap's triangles make no surface");
  }
  /// Values at new vertices that are harmonic but for `sources`.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& at_rim, const Eigen::MatrixXd& sources) const {
    return solver.solve(outer * at_rim + sources);
  }
  Eigen::SparseMatrix<double> inner, outer;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver;
};

/// Minus the divergence of the slopes, each triangle's the mean of its corners', at the new vertices.
Eigen::VectorXd sources_of(const Eigen::MatrixXd& slopes, std::size_t rim, const std::vector<Vec2>& plane,
                           const std::vector<PlaneTriangle>& triangles) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(plane.size() - rim));
  for (const PlaneTriangle& t : triangles) {
    const Vec2 slope = (slopes.row(t[0]) + slopes.row(t[1]) + slopes.row(t[2])).transpose() / 3;
    for (std::size_t k = 0; k < 3; ++k) {
      if (t[k] < rim) continue;
      // Area times the gradient of the vertex's hat function: half the opposite edge, turned inwards.
      const Vec2 edge = plane[t[(k + 2) % 3]] - plane[t[(k + 1) % 3]];
      out[t[k] - static_cast<Eigen::Index>(rim)] += 0.5 * slope.dot(Vec2(-edge.y(), edge.x()));
    }
  }
  return out;
}

/// Slopes of the rim above the quadric's, evened out along it: a steep one by chance would raise a spike beside it.
/// Vertices that do not fit have none.
std::vector<Vec2> slopes_above(const GapRim& around) {
  const Rim& rim = around.rim;
  std::vector<Vec2> slopes(rim.size(), Vec2::Zero());
  for (std::size_t i = 0; i < rim.size(); ++i) {
    if (around.fits[i]) slopes[i] = slope_of(rim.normals[i]) - around.quadric.slope(rim.points[i].head<2>());
  }
  for (int pass = 0; pass < kSlopeSmoothing; ++pass) {
    std::vector<Vec2> even(slopes.size(), Vec2::Zero());
    for (std::size_t i = 0; i < slopes.size(); ++i) {
      const std::size_t j = rim.next[i];
      even[i] += 0.25 * (slopes[i] + slopes[j]);
      even[j] += 0.25 * (slopes[i] + slopes[j]);
    }
    slopes = std::move(even);
  }
  return slopes;
}

}  // namespace

Vec2 slope_of(const Vec3& normal) {
  return -normal.head<2>() / std::max(normal.z(), kLeastNormalCosine);
}

Quadric::Quadric(const Rim& rim, double width) : scale_(2 / width) {
  const auto n = static_cast<Eigen::Index>(rim.size());
  Eigen::MatrixXd terms(3 * n, 6);
  Eigen::VectorXd values(3 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vec3 p = scale_ * rim.points[static_cast<std::size_t>(i)];
    terms.row(3 * i) << 1, p.x(), p.y(), p.x() * p.x(), p.x() * p.y(), p.y() * p.y();
    terms.row(3 * i + 1) << 0, 1, 0, 2 * p.x(), p.y(), 0;
    terms.row(3 * i + 2) << 0, 0, 1, 0, p.x(), 2 * p.y();
    values[3 * i] = p.z();
    values.segment<2>(3 * i + 1) = slope_of(rim.normals[static_cast<std::size_t>(i)]);
  }
  coefficients_ = terms.colPivHouseholderQr().solve(values);
}

double Quadric::height(const Vec2& at) const {
  const double x = scale_ * at.x(), y = scale_ * at.y();
  return coefficients_.dot(Eigen::Vector<double, 6>(1, x, y, x * x, x * y, y * y)) / scale_;
}

Vec2 Quadric::slope(const Vec2& at) const {
  const double x = scale_ * at.x(), y = scale_ * at.y();
  const auto& c = coefficients_;
  return Vec2(c[1] + 2 * c[3] * x + c[4] * y, c[2] + c[4] * x + 2 * c[5] * y);
}

GapSurface span_gap(const GapRim& around, const std::vector<Vec2>& plane, const std::vector<PlaneTriangle>& triangles) {
  GapSurface out;
  const auto& [rim, fits, quadric, attributes] = around;
  const std::size_t n = rim.size();
  const auto known = static_cast<Eigen::Index>(n);
  const auto fresh = static_cast<Eigen::Index>(plane.size() - n);
  if (fresh == 0) return out;
  const Laplacian laplacian(n, plane, triangles);
  // Slopes above the quadric's, the way back from the outline to the rim, attributes.
  Eigen::MatrixXd at_rim(known, 4 + attributes.cols());
  Eigen::VectorXd heights(known);
  const std::vector<Vec2> slopes_at_rim = slopes_above(around);
  for (Eigen::Index i = 0; i < known; ++i) {
    const auto v = static_cast<std::size_t>(i);
    const Vec2 at = rim.points[v].head<2>();
    at_rim.block<1, 2>(i, 0) = slopes_at_rim[v].transpose();
    at_rim.block<1, 2>(i, 2) = (at - plane[v]).transpose();
    heights[i] = rim.points[v].z() - quadric.height(at);
  }
  at_rim.rightCols(attributes.cols()) = attributes;
  const Eigen::MatrixXd smooth = laplacian.solve(at_rim, Eigen::MatrixXd::Zero(fresh, at_rim.cols()));
  Eigen::MatrixXd slopes(known + fresh, 2);
  slopes << at_rim.leftCols<2>(), smooth.leftCols<2>();
  const Eigen::VectorXd above = laplacian.solve(heights, sources_of(slopes, n, plane, triangles));
  for (Eigen::Index i = 0; i < fresh; ++i) {
    const Vec2 at = plane[n + static_cast<std::size_t>(i)] + smooth.block<1, 2>(i, 2).transpose();
    const Vec2 slope = quadric.slope(at) + smooth.block<1, 2>(i, 0).transpose();
    out.positions.emplace_back(at.x(), at.y(), quadric.height(at) + above[i]);
    out.normals.push_back(Vec3(-slope.x(), -slope.y(), 1).normalized());
  }
  out.attributes = smooth.rightCols(attributes.cols());
  return out;
}

}  // namespace lamina::boundary
