#include "boundary/triangulate_polygon.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/Geometry>

namespace lamina::boundary {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

/// A triangle of the plane counts as one when it is this high for its longest side.
constexpr double kLeastHeight = 1e-3;

double twice_area(const Vec2& a, const Vec2& b, const Vec2& c) {
  return cross(b - a, c - a);
}

bool is_proper(const Vec2& a, const Vec2& b, const Vec2& c) {
  const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return twice_area(a, b, c) > kLeastHeight * longest;
}

/// How far two facets fold, 0 (flat) to 2.
double fold(const Vec3& a, const Vec3& b) {
  const double length = std::sqrt(a.squaredNorm() * b.squaredNorm());
  return length > 0 ? 1 - a.dot(b) / length : 1;
}

struct Cost {
  double fold = std::numeric_limits<double>::infinity();
  double area = std::numeric_limits<double>::infinity();
  bool operator<(const Cost& o) const { return fold != o.fold ? fold < o.fold : area < o.area; }
};

class Polygon {
 public:
  /// `facing`: normals beside the polygon's edges; empty where folds do not matter.
  Polygon(const std::vector<Vec3>& corners, const std::vector<Vec3>& facing,
          const std::function<bool(std::uint32_t, std::uint32_t)>& allowed,
          bool (*proper)(const Vec3&, const Vec3&, const Vec3&))
      : corners_(corners),
        facing_(facing),
        proper_(proper),
        n_(static_cast<std::uint32_t>(corners.size())),
        cells_(n_ * n_) {
    for (std::uint32_t gap = 2; gap < n_; ++gap) {
      for (std::uint32_t i = 0; i + gap < n_; ++i) {
        const std::uint32_t k = i + gap;
        if (gap + 1 < n_ && !allowed(i, k)) continue;
        solve(i, k);
      }
    }
  }
  [[nodiscard]] bool solved() const { return std::isfinite(at(0, n_ - 1).cost.fold); }
  void list(std::vector<PlaneTriangle>& out) const { list(0, n_ - 1, out); }

 private:
  void list(std::uint32_t i, std::uint32_t k, std::vector<PlaneTriangle>& out) const {
    if (k < i + 2) return;
    const std::uint32_t j = at(i, k).middle;
    out.push_back({i, j, k});
    list(i, j, out);
    list(j, k, out);
  }
  struct Cell {
    Cost cost;
    std::uint32_t middle = 0;
  };
  [[nodiscard]] const Cell& at(std::uint32_t i, std::uint32_t k) const { return cells_[i * n_ + k]; }
  [[nodiscard]] Vec3 normal(std::uint32_t i, std::uint32_t j, std::uint32_t k) const {
    return (corners_[j] - corners_[i]).cross(corners_[k] - corners_[i]);
  }
  /// Of the triangle beside (i, j), on the side of the polygon's corners between.
  [[nodiscard]] Vec3 beside(std::uint32_t i, std::uint32_t j) const {
    return j == i + 1 ? facing_[i] : normal(i, at(i, j).middle, j);
  }
  void solve(std::uint32_t i, std::uint32_t k) {
    Cell& best = cells_[i * n_ + k];
    for (std::uint32_t j = i + 1; j < k; ++j) {
      if (!proper_(corners_[i], corners_[j], corners_[k])) continue;
      Cost cost{0, 0};
      if (j > i + 1) cost = at(i, j).cost;
      if (k > j + 1) {
        const Cost& other = at(j, k).cost;
        cost = {std::max(cost.fold, other.fold), cost.area + other.area};
      }
      if (!std::isfinite(cost.fold)) continue;
      const Vec3 here = normal(i, j, k);
      if (!facing_.empty()) {
        cost.fold = std::max({cost.fold, fold(here, beside(i, j)), fold(here, beside(j, k))});
        if (i == 0 && k == n_ - 1) cost.fold = std::max(cost.fold, fold(here, facing_[n_ - 1]));
      }
      cost.area += here.norm();
      if (cost < best.cost) best = {cost, j};
    }
  }

  const std::vector<Vec3>& corners_;
  std::vector<Vec3> facing_;
  bool (*proper_)(const Vec3&, const Vec3&, const Vec3&);
  std::uint32_t n_;
  std::vector<Cell> cells_;
};

std::optional<std::vector<PlaneTriangle>> triangles_of(const Polygon& polygon) {
  if (!polygon.solved()) return std::nullopt;
  std::vector<PlaneTriangle> triangles;
  polygon.list(triangles);
  return triangles;
}

using Edge = std::array<std::uint32_t, 2>;

Edge edge_of(std::uint32_t a, std::uint32_t b) {
  return {std::min(a, b), std::max(a, b)};
}

/// d lies in the circle around the anticlockwise triangle abc.
bool in_circle(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const Vec2 p = a - d, q = b - d, r = c - d;
  const double det = p.squaredNorm() * cross(q, r) - q.squaredNorm() * cross(p, r) + r.squaredNorm() * cross(p, q);
  const double size = p.squaredNorm() + q.squaredNorm() + r.squaredNorm();
  return det > 1e-9 * size * size;
}

/// The triangles beside each edge.
std::map<Edge, std::vector<std::uint32_t>> edges_of(const std::vector<PlaneTriangle>& triangles) {
  std::map<Edge, std::vector<std::uint32_t>> edges;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) edges[edge_of(triangles[t][k], triangles[t][(k + 1) % 3])].push_back(t);
  }
  return edges;
}

std::uint32_t opposite(const PlaneTriangle& t, const Edge& e) {
  for (const std::uint32_t v : t) {
    if (v != e[0] && v != e[1]) return v;
  }
  return t[0];
}

/// Flips what it can in one pass; false: all edges are Delaunay's.
bool flip_once(const std::vector<Vec2>& points, std::vector<PlaneTriangle>& triangles,
               const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  const auto edges = edges_of(triangles);
  std::vector<bool> touched(triangles.size(), false);
  bool any = false;
  for (const auto& [e, beside] : edges) {
    if (beside.size() != 2 || touched[beside[0]] || touched[beside[1]]) continue;
    std::uint32_t c = opposite(triangles[beside[0]], e);
    std::uint32_t d = opposite(triangles[beside[1]], e);
    // Anticlockwise: e[0], e[1], c on the left.
    if (twice_area(points[e[0]], points[e[1]], points[c]) < 0) std::swap(c, d);
    if (!in_circle(points[e[0]], points[e[1]], points[c], points[d])) continue;
    if (!is_proper(points[c], points[e[0]], points[d]) || !is_proper(points[d], points[e[1]], points[c])) continue;
    const Edge flipped = edge_of(c, d);
    if (edges.contains(flipped) || !allowed(flipped[0], flipped[1])) continue;
    triangles[beside[0]] = {c, e[0], d};
    triangles[beside[1]] = {d, e[1], c};
    touched[beside[0]] = touched[beside[1]] = any = true;
  }
  return any;
}

void flip_all(const std::vector<Vec2>& points, std::vector<PlaneTriangle>& triangles,
              const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  constexpr int kMostPasses = 50;
  for (int pass = 0; pass < kMostPasses && flip_once(points, triangles, allowed);) ++pass;
}

/// Splits triangles that are too large at their centre; whether any was.
bool split_large(std::vector<Vec2>& points, std::vector<double>& scale, std::vector<PlaneTriangle>& triangles) {
  const std::size_t count = triangles.size();
  for (std::size_t t = 0; t < count; ++t) {
    const auto [a, b, c] = triangles[t];
    const Vec2 centre = (points[a] + points[b] + points[c]) / 3;
    const double wanted = (scale[a] + scale[b] + scale[c]) / 3;
    const auto far = [&](std::uint32_t v) {
      const double d = std::sqrt(2.0) * (points[v] - centre).norm();
      return d > wanted && d > scale[v];
    };
    if (!far(a) || !far(b) || !far(c)) continue;
    if (!is_proper(points[a], points[b], centre) || !is_proper(points[b], points[c], centre) ||
        !is_proper(points[c], points[a], centre))
      continue;
    const auto v = static_cast<std::uint32_t>(points.size());
    points.push_back(centre);
    scale.push_back(wanted);
    triangles[t] = {a, b, v};
    triangles.push_back({b, c, v});
    triangles.push_back({c, a, v});
  }
  return triangles.size() > count;
}

}  // namespace

std::optional<std::vector<PlaneTriangle>> triangulate_polygon(
    const std::vector<Vec3>& corners, const std::vector<Vec3>& facing,
    const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  return triangles_of({corners, facing, allowed, [](const Vec3& a, const Vec3& b, const Vec3& c) {
                         return is_proper(a.head<2>(), b.head<2>(), c.head<2>());
                       }});
}

std::optional<std::vector<PlaneTriangle>> triangulate_by_area(
    const std::vector<Vec3>& corners, const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  return triangles_of(
      {corners, {}, allowed, [](const Vec3& a, const Vec3& b, const Vec3& c) {
         const double longest = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
         return (b - a).cross(c - a).norm() > kLeastHeight * longest;
       }});
}

void refine_triangles(std::vector<Vec2>& points, std::vector<double>& scale, std::vector<PlaneTriangle>& triangles,
                      const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  constexpr int kMostRounds = 12;
  for (int round = 0; round < kMostRounds && split_large(points, scale, triangles); ++round)
    flip_all(points, triangles, allowed);
}

}  // namespace lamina::boundary
