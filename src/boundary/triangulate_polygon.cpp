#include "boundary/gap_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <Eigen/Geometry>

namespace lamina::boundary {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

/// Triangles inside a gap grow by so much with the distance from its rim.
constexpr double kGrading = 0.2;

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

/// What is left of a polygon while its ears are cut off: corners that stick out, whose chord no other corner is in the
/// way of. The widest goes first, so that no sliver is left at the end which could not go.
class Ears {
 public:
  Ears(const std::vector<Vec2>& points, const std::vector<std::uint32_t>& polygon,
       const std::function<bool(std::uint32_t, std::uint32_t)>& allowed)
      : points_(points), polygon_(polygon), allowed_(allowed) {
    const std::size_t n = polygon.size();
    for (std::size_t i = 0; i < n; ++i) {
      next_.push_back((i + 1) % n);
      before_.push_back((i + n - 1) % n);
      edges_.insert(edge_of(polygon[i], polygon[(i + 1) % n]));
    }
    for (std::size_t i = 0; i < n; ++i) width_.push_back(width_of(i));
  }
  /// False where corners are left that are no ears.
  bool cut(std::vector<PlaneTriangle>& out) {
    std::size_t at = 0;
    for (std::size_t left = polygon_.size(); left > 3; --left) {
      at = find_widest();
      for (const bool any : {false, true}) {
        if (width_[at] > 0) break;
        any_chord_ = any_chord_ || any;
        look_again();
        at = find_widest();
      }
      if (!(width_[at] > 0)) return false;
      const std::size_t from = before_[at], to = next_[at];
      const Edge chord = edge_of(polygon_[from], polygon_[to]);
      // One that another triangle has by now.
      if (!edges_.insert(chord).second) {
        width_[at] = 0;
        ++left;
        continue;
      }
      out.push_back({polygon_[from], polygon_[at], polygon_[to]});
      next_[from] = to;
      before_[to] = from;
      width_[at] = kGone;
      width_[from] = width_of(from);
      width_[to] = width_of(to);
      at = to;
    }
    out.push_back({polygon_[before_[at]], polygon_[at], polygon_[next_[at]]});
    return twice_area(point(before_[at]), point(at), point(next_[at])) > 0;
  }

 private:
  static constexpr double kGone = -1;

  [[nodiscard]] const Vec2& point(std::size_t corner) const { return points_[polygon_[corner]]; }
  [[nodiscard]] std::size_t find_widest() const {
    return static_cast<std::size_t>(std::max_element(width_.begin(), width_.end()) - width_.begin());
  }
  /// What was in an ear's way may have gone with an ear elsewhere.
  void look_again() {
    for (std::size_t i = 0; i < width_.size(); ++i) {
      if (width_[i] >= 0) width_[i] = width_of(i);
    }
  }
  /// Height over length of the triangle that goes with an ear; 0: it is none.
  [[nodiscard]] double width_of(std::size_t at) const {
    const std::size_t from = before_[at], to = next_[at];
    const Vec2 &a = point(from), &b = point(at), &c = point(to);
    const Edge chord = edge_of(polygon_[from], polygon_[to]);
    const double twice = twice_area(a, b, c);
    if (!(twice > 0) || edges_.contains(chord) || (!any_chord_ && !allowed_(chord[0], chord[1]))) return 0;
    for (std::size_t i = next_[to]; i != from; i = next_[i]) {
      const std::uint32_t v = polygon_[i];
      if (v == polygon_[from] || v == polygon_[at] || v == polygon_[to]) continue;
      const Vec2& p = point(i);
      if (twice_area(a, b, p) >= 0 && twice_area(b, c, p) >= 0 && twice_area(c, a, p) >= 0) return 0;
    }
    return twice / std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  }
  const std::vector<Vec2>& points_;
  const std::vector<std::uint32_t>& polygon_;
  const std::function<bool(std::uint32_t, std::uint32_t)>& allowed_;
  std::vector<std::size_t> next_, before_;
  std::vector<double> width_;  ///< of each corner; kGone: it was cut off
  std::set<Edge> edges_;       ///< of the polygon and of all triangles
  bool any_chord_ = false;     ///< too few others are left
};

/// d lies in the circle around the anticlockwise triangle abc.
bool in_circle(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const Vec2 p = a - d, q = b - d, r = c - d;
  const double det = p.squaredNorm() * cross(q, r) - q.squaredNorm() * cross(p, r) + r.squaredNorm() * cross(p, q);
  const double size = p.squaredNorm() + q.squaredNorm() + r.squaredNorm();
  return det > 1e-9 * size * size;
}

/// An edge and a triangle beside it; sorted, those of one edge follow one another.
struct Side {
  Edge edge;
  std::uint32_t triangle;
  /// One number: sorting takes most of the time of a filling.
  [[nodiscard]] std::uint64_t key() const { return std::uint64_t{edge[0]} << 32 | edge[1]; }
  friend bool operator<(const Side& a, const Side& b) {
    const std::uint64_t one = a.key();
    const std::uint64_t other = b.key();
    return one < other || (one == other && a.triangle < b.triangle);
  }
};

void add_sides(const std::vector<PlaneTriangle>& triangles, std::uint32_t t, std::vector<Side>& sides) {
  for (std::size_t k = 0; k < 3; ++k) sides.push_back({edge_of(triangles[t][k], triangles[t][(k + 1) % 3]), t});
}

std::vector<Side> sides_of(const std::vector<PlaneTriangle>& triangles) {
  std::vector<Side> sides;
  sides.reserve(3 * triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t) add_sides(triangles, t, sides);
  std::sort(sides.begin(), sides.end());
  return sides;
}

/// Those of some triangles anew; the others keep their order.
void renew_sides(const std::vector<PlaneTriangle>& triangles, const std::vector<bool>& changed,
                 std::vector<Side>& sides) {
  std::erase_if(sides, [&](const Side& s) { return changed[s.triangle]; });
  const auto kept = static_cast<std::ptrdiff_t>(sides.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    if (changed[t]) add_sides(triangles, t, sides);
  }
  std::sort(sides.begin() + kept, sides.end());
  std::inplace_merge(sides.begin(), sides.begin() + kept, sides.end());
}

std::uint32_t opposite(const PlaneTriangle& t, const Edge& e) {
  for (const std::uint32_t v : t) {
    if (v != e[0] && v != e[1]) return v;
  }
  return t[0];
}

/// Flips what it can in one pass over the triangles' sides; false: all edges are Delaunay's.
bool flip_once(const std::vector<Vec2>& points, std::vector<PlaneTriangle>& triangles, std::vector<Side>& sides,
               const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  const auto is_edge = [&](const Edge& e) {
    const auto at = std::lower_bound(sides.begin(), sides.end(), Side{e, 0});
    return at != sides.end() && at->edge == e;
  };
  std::vector<bool> touched(triangles.size(), false);
  std::set<Edge> made;
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const Edge& e = sides[i].edge;
    const std::uint32_t left = sides[i].triangle, right = sides[i + 1].triangle;
    if (sides[i + 1].edge != e || touched[left] || touched[right]) continue;
    std::uint32_t c = opposite(triangles[left], e);
    std::uint32_t d = opposite(triangles[right], e);
    // Anticlockwise: e[0], e[1], c on the left.
    if (twice_area(points[e[0]], points[e[1]], points[c]) < 0) std::swap(c, d);
    if (!in_circle(points[e[0]], points[e[1]], points[c], points[d])) continue;
    if (!is_proper(points[c], points[e[0]], points[d]) || !is_proper(points[d], points[e[1]], points[c])) continue;
    const Edge flipped = edge_of(c, d);
    if (is_edge(flipped) || !allowed(flipped[0], flipped[1]) || !made.insert(flipped).second) continue;
    triangles[left] = {c, e[0], d};
    triangles[right] = {d, e[1], c};
    touched[left] = touched[right] = true;
  }
  if (!made.empty()) renew_sides(triangles, touched, sides);
  return !made.empty();
}

void flip_all(const std::vector<Vec2>& points, std::vector<PlaneTriangle>& triangles,
              const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  constexpr int kMostPasses = 50;
  std::vector<Side> sides = sides_of(triangles);
  for (int pass = 0; pass < kMostPasses && flip_once(points, triangles, sides, allowed);) ++pass;
}

/// Splits edges within that are not allowed in their middle.
void split_forbidden(std::vector<Vec2>& points, std::vector<double>& scale, std::vector<PlaneTriangle>& triangles,
                     const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  const std::vector<Side> sides = sides_of(triangles);
  std::vector<bool> touched(triangles.size(), false);
  bool again = false;
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const auto [a, b] = sides[i].edge;
    const std::array<std::uint32_t, 2> beside{sides[i].triangle, sides[i + 1].triangle};
    if (sides[i + 1].edge != sides[i].edge || allowed(a, b)) continue;
    if (touched[beside[0]] || touched[beside[1]]) {
      again = true;
      continue;
    }
    const auto middle = static_cast<std::uint32_t>(points.size());
    points.push_back(0.5 * (points[a] + points[b]));
    scale.push_back(0.5 * (scale[a] + scale[b]));
    for (const std::uint32_t t : beside) {
      touched[t] = true;
      PlaneTriangle half = triangles[t];
      std::replace(triangles[t].begin(), triangles[t].end(), a, middle);
      std::replace(half.begin(), half.end(), b, middle);
      triangles.push_back(half);
    }
  }
  if (again) split_forbidden(points, scale, triangles, allowed);
}

/// Splits triangles that are too large at their centre; whether any was.
bool split_large(std::vector<Vec2>& points, std::vector<double>& scale, std::vector<PlaneTriangle>& triangles) {
  const std::size_t count = triangles.size();
  for (std::size_t t = 0; t < count; ++t) {
    const auto [a, b, c] = triangles[t];
    const Vec2 centre = (points[a] + points[b] + points[c]) / 3;
    const auto graded = [&](std::uint32_t v) { return scale[v] + kGrading * (points[v] - centre).norm(); };
    const double wanted = std::min({graded(a), graded(b), graded(c)});
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

std::optional<std::vector<PlaneTriangle>> triangulate_by_ears(
    const std::vector<Vec2>& points, const std::vector<std::uint32_t>& polygon,
    const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  if (polygon.size() < 3) return std::nullopt;
  Ears ears(points, polygon, allowed);
  std::vector<PlaneTriangle> triangles;
  if (!ears.cut(triangles)) return std::nullopt;
  return triangles;
}

void refine_triangles(std::vector<Vec2>& points, std::vector<double>& scale, std::vector<PlaneTriangle>& triangles,
                      const std::function<bool(std::uint32_t, std::uint32_t)>& allowed) {
  constexpr int kMostRounds = 40;
  split_forbidden(points, scale, triangles, allowed);
  flip_all(points, triangles, allowed);
  for (int round = 0; round < kMostRounds && split_large(points, scale, triangles); ++round)
    flip_all(points, triangles, allowed);
}

}  // namespace lamina::boundary
