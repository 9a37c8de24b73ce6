#include "measure/triangle_bvh.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

namespace lamina::measure {

using namespace meshes;

namespace {

constexpr std::uint32_t kLeafTriangles = 4;
constexpr std::uint32_t kParallelTriangles = 1u << 14;
constexpr int kBins = 16;
constexpr int kMaxDepth = 96;  // the builder halves by count once it is this deep less 32: the stack cannot overflow

float round_down(double v) {
  return std::nextafter(static_cast<float>(v), -std::numeric_limits<float>::infinity());
}
float round_up(double v) {
  return std::nextafter(static_cast<float>(v), std::numeric_limits<float>::infinity());
}

/// Squared distance from p to the segment a-b (a == b allowed).
double squared_distance_to_segment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 ab = b - a, ap = p - a;
  const double length2 = dot(ab, ab);
  const double t = length2 > 0 ? std::fmin(1.0, std::fmax(0.0, dot(ap, ab) / length2)) : 0.0;
  const Vec3 d = ap - t * ab;
  return dot(d, d);
}

}  // namespace

double squared_distance_to_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a;
  const Vec3 n = cross(ab, ac);
  const double n2 = dot(n, n);
  if (n2 > 1e-24 * dot(ab, ab) * dot(ac, ac)) {
    // Barycentric coordinates of the projection; inside, the distance is the height over the plane.
    const double wc = dot(cross(ab, ap), n), wb = dot(cross(ap, ac), n);
    if (wb >= 0 && wc >= 0 && wb + wc <= n2) {
      const double h = dot(ap, n);
      return h * h / n2;
    }
  }
  return std::fmin(squared_distance_to_segment(p, a, b),
                   std::fmin(squared_distance_to_segment(p, b, c), squared_distance_to_segment(p, c, a)));
}

void widen(Bounds& bounds, const Vec3& p) {
  for (std::size_t k = 0; k < 3; ++k) {
    bounds.low[k] = std::min(bounds.low[k], p[k]);
    bounds.high[k] = std::max(bounds.high[k], p[k]);
  }
}

Bounds triangle_bounds(const TriangleMesh& mesh) {
  Bounds bounds{mesh.positions[mesh.triangles[0][0]], mesh.positions[mesh.triangles[0][0]]};
  for (const auto& t : mesh.triangles)
    for (const auto v : t) widen(bounds, mesh.positions[v]);
  return bounds;
}

/// Top-down, binned surface area heuristic (Wald 2007). The tree's shape depends on the mesh alone.
struct TriangleBvh::Builder {
  const TriangleMesh& mesh;
  const Vec3& centre;
  std::vector<std::uint32_t>& order;
  std::vector<Node>& nodes;
  std::vector<Box> boxes;  ///< per triangle
  std::atomic<std::uint32_t> used{1};

  static Box empty() {
    constexpr float inf = std::numeric_limits<float>::infinity();
    return {{inf, inf, inf}, {-inf, -inf, -inf}};
  }
  static void grow(Box& b, const Box& other) {
    for (std::size_t k = 0; k < 3; ++k) {
      b.low[k] = std::min(b.low[k], other.low[k]);
      b.high[k] = std::max(b.high[k], other.high[k]);
    }
  }
  static float half_area(const Box& b) {
    const float x = b.high[0] - b.low[0], y = b.high[1] - b.low[1], z = b.high[2] - b.low[2];
    return x * y + y * z + z * x;
  }
  static float middle(const Box& b, std::size_t axis) { return 0.5F * (b.low[axis] + b.high[axis]); }

  void bound_triangles() {
    boxes.resize(mesh.triangles.size());
    tbb::parallel_for(std::size_t{0}, boxes.size(), [&](std::size_t t) {
      Box b = empty();
      for (const auto v : mesh.triangles[t])
        for (std::size_t k = 0; k < 3; ++k) {
          const double c = mesh.positions[v][k] - centre[k];
          b.low[k] = std::min(b.low[k], round_down(c));
          b.high[k] = std::max(b.high[k], round_up(c));
        }
      boxes[t] = b;
    });
  }

  /// The best split found; count of triangles on its left, 0 when a leaf or a split by count is better.
  std::uint32_t partition(std::uint32_t first, std::uint32_t count, const Box& centres) {
    std::size_t axis = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (centres.high[k] - centres.low[k] > centres.high[axis] - centres.low[axis]) axis = k;
    const float low = centres.low[axis], extent = centres.high[axis] - low;
    if (!(extent > 0)) return 0;
    const float scale = static_cast<float>(kBins) / extent;
    const auto bin_of = [&](std::uint32_t t) {
      return std::clamp(static_cast<int>((middle(boxes[t], axis) - low) * scale), 0, kBins - 1);
    };
    std::array<Box, kBins> bin_box;
    bin_box.fill(empty());
    std::array<std::uint32_t, kBins> bin_count{};
    for (std::uint32_t i = first; i < first + count; ++i) {
      const auto b = static_cast<std::size_t>(bin_of(order[i]));
      grow(bin_box[b], boxes[order[i]]);
      ++bin_count[b];
    }
    std::array<float, kBins> right_cost{};
    Box right = empty();
    std::uint32_t right_count = 0;
    for (std::size_t b = kBins - 1; b > 0; --b) {
      grow(right, bin_box[b]);
      right_count += bin_count[b];
      right_cost[b] = right_count == 0 ? 0 : half_area(right) * static_cast<float>(right_count);
    }
    Box left = empty();
    std::uint32_t left_count = 0;
    float best = std::numeric_limits<float>::infinity();
    int split = 0;
    for (std::size_t b = 1; b < kBins; ++b) {
      grow(left, bin_box[b - 1]);
      left_count += bin_count[b - 1];
      if (left_count == 0 || left_count == count) continue;
      const float cost = half_area(left) * static_cast<float>(left_count) + right_cost[b];
      if (cost < best) best = cost, split = static_cast<int>(b);
    }
    if (split == 0) return 0;
    const auto begin = order.begin() + first;
    return static_cast<std::uint32_t>(
        std::partition(begin, begin + count, [&](std::uint32_t t) { return bin_of(t) < split; }) - begin);
  }

  void build(std::uint32_t node, std::uint32_t first, std::uint32_t count, int depth) {
    Box box = empty(), centres = empty();
    for (std::uint32_t i = first; i < first + count; ++i) {
      const Box& b = boxes[order[i]];
      grow(box, b);
      const std::array<float, 3> m{middle(b, 0), middle(b, 1), middle(b, 2)};
      grow(centres, {m, m});
    }
    nodes[node].box = box;
    if (count <= kLeafTriangles) {
      nodes[node].first = first;
      nodes[node].count = count;
      return;
    }
    std::uint32_t left = depth < kMaxDepth - 32 ? partition(first, count, centres) : 0;
    if (left == 0) left = count / 2;
    const std::uint32_t children = used.fetch_add(2);
    nodes[node].first = children;
    const auto build_left = [&] { build(children, first, left, depth + 1); };
    const auto build_right = [&] { build(children + 1, first + left, count - left, depth + 1); };
    if (count > kParallelTriangles) {
      tbb::parallel_invoke(build_left, build_right);
    } else {
      build_left();
      build_right();
    }
  }
};

TriangleBvh::TriangleBvh(const TriangleMesh& mesh) : mesh_(mesh), order_(mesh.triangles.size()) {
  const Bounds bounds = triangle_bounds(mesh);
  centre_ = 0.5 * (bounds.low + bounds.high);
  for (std::size_t t = 0; t < order_.size(); ++t) order_[t] = static_cast<std::uint32_t>(t);
  nodes_.resize(2 * order_.size());
  Builder builder{mesh_, centre_, order_, nodes_, {}};
  builder.bound_triangles();
  builder.build(0, 0, static_cast<std::uint32_t>(order_.size()), 0);
  nodes_.resize(builder.used);
  nodes_.shrink_to_fit();
}

double TriangleBvh::squared_distance_to_box(const Vec3& p, const Box& box) {
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double d = std::max({box.low[k] - p[k], 0.0, p[k] - box.high[k]});
    sum += d * d;
  }
  return sum;
}

NearestTriangle TriangleBvh::nearest(const Vec3& p, double bound) const {
  struct Entry {
    std::uint32_t node;
    double bound;
  };
  std::array<Entry, kMaxDepth> stack;
  std::size_t depth = 0;
  const Vec3 local = p - centre_;
  double best = bound * bound;
  std::uint32_t triangle = 0;
  stack[depth++] = {0, 0.0};
  while (depth > 0) {
    const Entry e = stack[--depth];
    if (e.bound >= best) continue;
    const Node& node = nodes_[e.node];
    if (node.count > 0) {
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
        const auto& c = mesh_.triangles[order_[i]];
        const double d2 =
            squared_distance_to_triangle(p, mesh_.positions[c[0]], mesh_.positions[c[1]], mesh_.positions[c[2]]);
        if (d2 < best) best = d2, triangle = order_[i];
      }
      continue;
    }
    Entry near{node.first, squared_distance_to_box(local, nodes_[node.first].box)};
    Entry far{node.first + 1, squared_distance_to_box(local, nodes_[node.first + 1].box)};
    if (far.bound < near.bound) std::swap(near, far);
    if (far.bound < best) stack[depth++] = far;
    if (near.bound < best) stack[depth++] = near;
  }
  return {std::sqrt(best), triangle};
}

std::optional<double> TriangleBvh::entry(const Vec3& origin, const Vec3& inverse, const Box& box) {
  double near = 0, far = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 3; ++k) {
    const double a = (box.low[k] - origin[k]) * inverse[k], b = (box.high[k] - origin[k]) * inverse[k];
    // fmin and fmax pass over the NaN of a ray that runs inside a face's plane.
    near = std::fmax(near, std::fmin(a, b));
    far = std::fmin(far, std::fmax(a, b));
  }
  if (near > far) return std::nullopt;
  return near;
}

std::optional<RayHit> TriangleBvh::first_hit(const Vec3& origin, const Vec3& direction) const {
  const Vec3 local = origin - centre_;
  const Vec3 inverse{1 / direction[0], 1 / direction[1], 1 / direction[2]};
  std::array<std::uint32_t, kMaxDepth> stack;
  std::size_t depth = 0;
  std::optional<RayHit> best;
  stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = nodes_[stack[--depth]];
    const auto at = entry(local, inverse, node.box);
    if (!at || (best && *at > best->distance)) continue;
    if (node.count == 0) {
      const auto left = entry(local, inverse, nodes_[node.first].box),
                 right = entry(local, inverse, nodes_[node.first + 1].box);
      const bool left_first = left && (!right || *left <= *right);
      if (left && right) stack[depth++] = node.first + (left_first ? 1 : 0);
      if (left || right) stack[depth++] = node.first + (left_first ? 0 : 1);
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const auto& c = mesh_.triangles[order_[i]];
      const Vec3& a = mesh_.positions[c[0]];
      const Vec3 ab = mesh_.positions[c[1]] - a, ac = mesh_.positions[c[2]] - a, ao = origin - a;
      // Moeller and Trumbore 1997.
      const Vec3 q = cross(direction, ac);
      const double det = dot(ab, q);
      if (det == 0) continue;
      const double u = dot(ao, q) / det;
      const Vec3 s = cross(ao, ab);
      const double v = dot(direction, s) / det, t = dot(ac, s) / det;
      if (u < 0 || v < 0 || u + v > 1 || !(t > 0)) continue;
      // Of triangles hit at the same place the first of the mesh counts: no matter how the tree was walked.
      if (best && (t > best->distance || (t == best->distance && order_[i] > best->triangle))) continue;
      best = RayHit{t, order_[i], {1 - u - v, u, v}};
    }
  }
  return best;
}

}  // namespace lamina::measure
