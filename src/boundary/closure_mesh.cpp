#include "boundary/fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

// OpenMesh's headers are not free of warnings.
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include <Eigen/Geometry>

namespace lamina::boundary {
namespace {

/// Each ring has this share of the vertices of the one around it.
constexpr std::uint64_t kRingNumerator = 3, kRingDenominator = 5;
constexpr std::size_t kLastRing = 8;
constexpr int kEveningPasses = 4;
constexpr int kFlippingPasses = 6;
/// A polygon so bent that its triangles never come to an end is left as it is then.
constexpr std::size_t kMostPerRimVertex = 24;

struct ClosureTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
  VertexAttributes(OpenMesh::Attributes::Status);
  EdgeAttributes(OpenMesh::Attributes::Status);
  FaceAttributes(OpenMesh::Attributes::Status);
  HalfedgeAttributes(OpenMesh::Attributes::Status);
};
using ClosureMesh = OpenMesh::TriMesh_ArrayKernelT<ClosureTraits>;
using VertexHandle = OpenMesh::VertexHandle;
using EdgeHandle = OpenMesh::EdgeHandle;
using HalfedgeHandle = OpenMesh::HalfedgeHandle;

/// Triangles between a ring of `a` vertices from `outer` on and one of `b` from `inner` on.
void add_strip(std::uint32_t outer, std::uint64_t a, std::uint32_t inner, std::uint64_t b, Triangles& out) {
  std::uint64_t i = 0, j = 0;
  const auto at = [](std::uint32_t first, std::uint64_t k, std::uint64_t n) {
    return first + static_cast<std::uint32_t>(k % n);
  };
  while (i < a || j < b) {
    if (j == b || (i < a && (i + 1) * b <= (j + 1) * a)) {
      out.push_back({at(outer, i, a), at(outer, i + 1, a), at(inner, j, b)});
      ++i;
    } else {
      out.push_back({at(outer, i, a), at(inner, j + 1, b), at(inner, j, b)});
      ++j;
    }
  }
}

class Evening {
 public:
  explicit Evening(const Disc& disc) : rim_(disc.rim) {
    for (const Eigen::Vector3d& p : disc.points) mesh_.add_vertex({p.x(), p.y(), p.z()});
    for (const auto& t : disc.triangles) mesh_.add_face(vertex(t[0]), vertex(t[1]), vertex(t[2]));
  }

  void run() {
    for (int pass = 0; pass < kEveningPasses; ++pass) {
      find_wanted();
      const bool split = split_long(), contracted = contract_short(), flipped = flip();
      if (!split && !contracted && !flipped) return;
    }
  }

  void store(Disc& disc) const {
    disc.points.resize(mesh_.n_vertices());
    for (std::size_t i = rim_; i < disc.points.size(); ++i) {
      const auto& p = mesh_.point(vertex(static_cast<std::uint32_t>(i)));
      disc.points[i] = {p[0], p[1], p[2]};
    }
    disc.triangles.clear();
    for (const auto face : mesh_.faces()) {
      std::array<std::uint32_t, 3> t{};
      std::size_t k = 0;
      for (auto v = mesh_.cfv_ccwiter(face); v.is_valid() && k < 3; ++v) t[k++] = static_cast<std::uint32_t>(v->idx());
      disc.triangles.push_back(t);
    }
  }

 private:
  static VertexHandle vertex(std::uint32_t i) { return VertexHandle(static_cast<int>(i)); }
  [[nodiscard]] bool is_rim(VertexHandle v) const { return static_cast<std::size_t>(v.idx()) < rim_; }
  [[nodiscard]] double length(VertexHandle a, VertexHandle b) const { return (mesh_.point(a) - mesh_.point(b)).norm(); }
  double& wanted(VertexHandle v) { return wanted_[static_cast<std::size_t>(v.idx())]; }

  /// Lengths wanted: the rim's own there, growing inwards (Dijkstra over the edges).
  void find_wanted() {
    wanted_.assign(mesh_.n_vertices(), std::numeric_limits<double>::infinity());
    using Entry = std::pair<double, int>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    for (std::uint32_t i = 0; i < rim_; ++i) {
      const auto n = static_cast<std::uint32_t>(rim_);
      const double own = 0.5 * (length(vertex(i), vertex((i + 1) % n)) + length(vertex(i), vertex((i + n - 1) % n)));
      wanted(vertex(i)) = own;
      queue.emplace(own, static_cast<int>(i));
    }
    while (!queue.empty()) {
      const auto [value, index] = queue.top();
      queue.pop();
      const VertexHandle v(index);
      if (value > wanted(v)) continue;
      for (auto w = mesh_.cvv_iter(v); w.is_valid(); ++w) {
        const double there = value + kClosureGrading * length(v, *w);
        if (there >= wanted(*w)) continue;
        wanted(*w) = there;
        queue.emplace(there, w->idx());
      }
    }
  }

  double wanted_at(HalfedgeHandle h) {
    return 0.5 * (wanted(mesh_.from_vertex_handle(h)) + wanted(mesh_.to_vertex_handle(h)));
  }

  // Each tells whether it has changed anything.

  bool split_long() {
    const std::size_t edges = mesh_.n_edges();
    const std::size_t most = kMostPerRimVertex * (rim_ + 16);
    for (std::size_t e = 0; e < edges && mesh_.n_vertices() < most; ++e) {
      const EdgeHandle edge(static_cast<int>(e));
      if (mesh_.is_boundary(edge)) continue;
      const HalfedgeHandle h = mesh_.halfedge_handle(edge, 0);
      if (mesh_.calc_edge_length(edge) <= kLongestEdge * wanted_at(h)) continue;
      wanted_.push_back(wanted_at(h));
      mesh_.split(edge, mesh_.add_vertex(mesh_.calc_edge_midpoint(edge)));
    }
    return mesh_.n_edges() > edges;
  }

  /// Whether the edges that `gone` leaves to `stays` would be no longer than wanted.
  bool keeps_lengths(VertexHandle gone, VertexHandle stays) {
    for (auto w = mesh_.cvv_iter(gone); w.is_valid(); ++w) {
      if (*w != stays && length(*w, stays) > kLongestEdge * 0.5 * (wanted(*w) + wanted(stays))) return false;
    }
    return true;
  }

  bool contract_short() {
    bool any = false;
    const std::size_t edges = mesh_.n_edges();
    for (std::size_t e = 0; e < edges; ++e) {
      const EdgeHandle edge(static_cast<int>(e));
      if (mesh_.status(edge).deleted()) continue;
      const HalfedgeHandle h = mesh_.halfedge_handle(edge, 0);
      const VertexHandle gone = mesh_.from_vertex_handle(h), stays = mesh_.to_vertex_handle(h);
      if (is_rim(gone) || is_rim(stays) || mesh_.calc_edge_length(edge) >= kShortestEdge * wanted_at(h)) continue;
      if (!mesh_.is_collapse_ok(h) || !keeps_lengths(gone, stays)) continue;
      mesh_.collapse(h);
      any = true;
    }
    if (any) forget_collapsed();
    return any;
  }

  /// The rim's vertices come first and none of them goes: they keep their numbers.
  void forget_collapsed() {
    // With handles to be kept up to date, none here, this is compiled with the program; what OpenMesh's library holds
    // may make a string for every element, to check its type.
    std::array<VertexHandle*, 0> vertices{};
    std::array<HalfedgeHandle*, 0> halfedges{};
    std::array<OpenMesh::FaceHandle*, 0> faces{};
    mesh_.garbage_collection(vertices, halfedges, faces);
  }

  [[nodiscard]] double cotangent_at(VertexHandle a, VertexHandle b, VertexHandle c) const {
    const auto u = mesh_.point(b) - mesh_.point(a), v = mesh_.point(c) - mesh_.point(a);
    return (u | v) / std::max((u % v).norm(), 1e-12 * u.norm() * v.norm() + std::numeric_limits<double>::min());
  }

  bool flip() {
    bool ever = false;
    for (int pass = 0; pass < kFlippingPasses; ++pass) {
      bool any = false;
      for (const auto edge : mesh_.edges()) {
        if (mesh_.is_boundary(edge)) continue;
        const HalfedgeHandle h = mesh_.halfedge_handle(edge, 0), other = mesh_.halfedge_handle(edge, 1);
        const VertexHandle a = mesh_.from_vertex_handle(h), b = mesh_.to_vertex_handle(h);
        const VertexHandle c = mesh_.to_vertex_handle(mesh_.next_halfedge_handle(h));
        const VertexHandle d = mesh_.to_vertex_handle(mesh_.next_halfedge_handle(other));
        if (is_rim(c) && is_rim(d)) continue;
        if (cotangent_at(c, a, b) + cotangent_at(d, a, b) > -1e-3 || !mesh_.is_flip_ok(edge)) continue;
        mesh_.flip(edge);
        any = true;
      }
      if (!any) break;
      ever = true;
    }
    return ever;
  }

  std::size_t rim_;
  ClosureMesh mesh_;
  std::vector<double> wanted_;
};

}  // namespace

Disc nested_rings(const Points& polygon) {
  Disc disc{polygon.size(), polygon, {}};
  std::uint32_t first = 0;
  std::uint64_t count = polygon.size();
  while (count > kLastRing) {
    const std::uint64_t fewer = (count * kRingNumerator + kRingDenominator - 1) / kRingDenominator;
    const auto next = static_cast<std::uint32_t>(disc.points.size());
    add_strip(first, count, next, fewer, disc.triangles);
    disc.points.resize(disc.points.size() + fewer, Eigen::Vector3d::Zero());
    first = next;
    count = fewer;
  }
  const auto middle = static_cast<std::uint32_t>(disc.points.size());
  disc.points.emplace_back(Eigen::Vector3d::Zero());
  for (std::uint32_t i = 0; i < count; ++i)
    disc.triangles.push_back({first + i, first + (i + 1) % static_cast<std::uint32_t>(count), middle});
  return disc;
}

Points normals_around(const Points& points, const Triangles& triangles) {
  Points normals(points.size(), Eigen::Vector3d::Zero());
  for (const auto& t : triangles) {
    const Eigen::Vector3d& a = points[t[0]];
    const Eigen::Vector3d normal = (points[t[1]] - a).cross(points[t[2]] - a);
    for (const std::uint32_t v : t) normals[v] += normal;
  }
  return normals;
}

void make_even(Disc& disc) {
  Evening evening(disc);
  evening.run();
  evening.store(disc);
}

}  // namespace lamina::boundary
