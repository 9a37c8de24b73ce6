#include "lamina/simplify.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <queue>
#include <tuple>
#include <utility>
#include <vector>

#include "lamina/error.h"
#include "lamina/measure.h"
#include "meshes/vec3.h"
#include "simplify/fans.h"
#include "simplify/quadric.h"

namespace lamina {
namespace {

using namespace meshes;
using simplify::Fans;
using simplify::Quadric;
using simplify::Triangle;

constexpr double kNormalNoise = 1e-3;  ///< of planes: about what floats leave of a small triangle's normal
constexpr double kBoundaryWeight = 1;  ///< of planes through boundary edges, beside the squared edge
constexpr double kLeastCosine = 0.2;   ///< a triangle turns no farther at one contraction
constexpr double kSliver = 0.05;       ///< no contraction makes triangles worse than this (1: equilateral)

class Simplifier {
 public:
  explicit Simplifier(TriangleMesh& mesh)
      : mesh_(mesh),
        fans_(mesh.triangles, mesh.positions.size()),
        quadrics_(mesh.positions.size()),
        version_(mesh.positions.size()),
        floats_(std::all_of(mesh.positions.begin(), mesh.positions.end(), [](const Vec3& p) {
          return std::all_of(p.begin(), p.end(), [](double c) { return as_float(c) == c; });
        })) {
    centre();
    sum_quadrics();
    for (const Triangle& t : fans_.triangles()) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t u = t[k], v = t[(k + 1) % 3];
        if (u < v || fans_.sides(u, v) == 1) offer(std::min(u, v), std::max(u, v));
      }
    }
  }

  SimplifyStats run(std::uint64_t wanted, const RunContext& run) {
    SimplifyStats stats;
    std::uint64_t left = mesh_.triangles.size();
    stats.triangles_before = left;
    while (left > wanted && !queue_.empty()) {
      const Contraction c = queue_.top();
      queue_.pop();
      if (c.version != version_[c.u] + version_[c.v] || !fans_.used(c.u) || !fans_.used(c.v)) continue;
      if (!fans_.contractible(c.u, c.v) || !keeps_shape(c)) continue;
      left -= static_cast<std::uint64_t>(contract(c));
      ++stats.contractions;
      if (stats.contractions % 4096 == 0 && run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    }
    stats.triangles_after = left;
    stats.reached = left <= wanted;
    return stats;
  }

  /// What is left, into the mesh.
  void finish() {
    constexpr std::uint32_t kGone = std::numeric_limits<std::uint32_t>::max();
    std::vector<std::uint32_t> number(mesh_.positions.size(), kGone);
    std::uint32_t kept = 0;
    for (std::uint32_t v = 0; v < number.size(); ++v) {
      if (!fans_.used(v)) continue;
      number[v] = kept;
      mesh_.positions[kept] = mesh_.positions[v];
      if (!mesh_.normals.empty()) mesh_.normals[kept] = mesh_.normals[v];
      for (auto& values : mesh_.attributes) values[kept] = values[v];
      ++kept;
    }
    mesh_.positions.resize(kept);
    if (!mesh_.normals.empty()) mesh_.normals.resize(kept);
    for (auto& values : mesh_.attributes) values.resize(kept);
    mesh_.triangles.clear();
    for (std::uint32_t t = 0; t < fans_.triangles().size(); ++t) {
      if (!fans_.alive(t)) continue;
      const Triangle& corners = fans_.triangles()[t];
      mesh_.triangles.push_back({number[corners[0]], number[corners[1]], number[corners[2]]});
    }
  }

 private:
  struct Contraction {
    double cost;
    std::uint32_t u, v;
    std::uint64_t version;
    Vec3 to;
    /// For a queue with the cheapest on top; equal ones by their vertices.
    bool operator<(const Contraction& o) const {
      return std::tie(o.cost, o.u, o.v, o.version) < std::tie(cost, u, v, version);
    }
  };

  static double as_float(double c) { return static_cast<double>(static_cast<float>(c)); }

  [[nodiscard]] const Vec3& at(std::uint32_t v) const { return mesh_.positions[v]; }

  void centre() {
    Vec3 low = at(mesh_.triangles[0][0]), high = low;
    for (const Triangle& t : mesh_.triangles) {
      for (const std::uint32_t v : t) {
        for (std::size_t k = 0; k < 3; ++k) {
          low[k] = std::min(low[k], at(v)[k]);
          high[k] = std::max(high[k], at(v)[k]);
        }
      }
    }
    centre_ = 0.5 * (low + high);
  }

  /// Quadrics are about the middle of the mesh: far from the origin they would lose their digits.
  void sum_quadrics() {
    for (const Triangle& t : mesh_.triangles) {
      const Vec3 n = cross(at(t[1]) - at(t[0]), at(t[2]) - at(t[0]));
      const double area = 0.5 * norm(n);
      if (!(area > 0)) continue;
      const Vec3 normal = unit(n);
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t u = t[k], v = t[(k + 1) % 3];
        quadrics_[u] += simplify::plane_quadric(at(u) - centre_, normal, area, kNormalNoise);
        if (fans_.sides(u, v) > 1) continue;
        const Vec3 edge = at(v) - at(u);
        const Quadric wall = simplify::plane_quadric(at(u) - centre_, unit(cross(edge, normal)),
                                                     kBoundaryWeight * dot(edge, edge), kNormalNoise);
        quadrics_[u] += wall;
        quadrics_[v] += wall;
      }
    }
  }

  /// Puts the edge into the queue.
  void offer(std::uint32_t u, std::uint32_t v) {
    Quadric sum = quadrics_[u];
    sum += quadrics_[v];
    const Vec3 a = at(u) - centre_, b = at(v) - centre_, middle = 0.5 * (a + b), edge = b - a;
    Vec3 best = middle;
    double cost = sum.at(middle);
    for (const Vec3& end : {a, b}) {
      if (const double c = sum.at(end); c < cost) cost = c, best = end;
    }
    if (const auto least = sum.least()) {
      const Vec3 off = *least - middle;
      if (const double c = sum.at(*least); c < cost && dot(off, off) < 4 * dot(edge, edge)) cost = c, best = *least;
    }
    best = best + centre_;
    if (floats_) {
      for (double& c : best) c = as_float(c);
    }
    queue_.push({std::max(0.0, cost), u, v, version_[u] + version_[v], best});
  }

  /// Do the triangles that stay keep their side and an area?
  bool keeps_shape(const Contraction& c) {
    for (const auto& [vertex, other] : {std::pair{c.u, c.v}, std::pair{c.v, c.u}}) {
      fans_.around(vertex, around_);
      for (const std::uint32_t triangle : around_) {
        const Triangle& t = fans_.triangles()[triangle];
        if (std::find(t.begin(), t.end(), other) != t.end()) continue;
        const auto k = static_cast<std::size_t>(std::find(t.begin(), t.end(), vertex) - t.begin());
        const Vec3 &p = at(t[(k + 1) % 3]), &q = at(t[(k + 2) % 3]);
        const Vec3 before = cross(p - at(vertex), q - at(vertex)), after = cross(p - c.to, q - c.to);
        if (!(dot(before, after) > kLeastCosine * norm(before) * norm(after))) return false;
        if (shape(c.to, p, q, after) < std::min(kSliver, shape(at(vertex), p, q, before))) return false;
      }
    }
    return true;
  }
  static double shape(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& twice_area) {
    const double sides = dot(b - a, b - a) + dot(c - b, c - b) + dot(a - c, a - c);
    return 2 * std::sqrt(3.0) * norm(twice_area) / sides;
  }

  int contract(const Contraction& c) {
    const Vec3 edge = at(c.v) - at(c.u);
    const double length2 = dot(edge, edge);
    const double t = length2 > 0 ? std::clamp(dot(c.to - at(c.u), edge) / length2, 0.0, 1.0) : 0.5;
    const auto share = static_cast<float>(t);
    if (!mesh_.normals.empty()) {
      const Vec3 mixed = (1 - t) * to_double(mesh_.normals[c.u]) + t * to_double(mesh_.normals[c.v]);
      if (norm(mixed) > 0) mesh_.normals[c.u] = to_float(unit(mixed));
    }
    for (auto& values : mesh_.attributes) values[c.u] += share * (values[c.v] - values[c.u]);
    mesh_.positions[c.u] = c.to;
    quadrics_[c.u] += quadrics_[c.v];
    const int gone = fans_.contract(c.u, c.v);
    ++version_[c.u];
    fans_.neighbours(c.u, near_);
    for (const std::uint32_t v : near_) offer(std::min(c.u, v), std::max(c.u, v));
    return gone;
  }

  TriangleMesh& mesh_;
  Fans fans_;
  std::vector<Quadric> quadrics_;
  std::vector<std::uint64_t> version_;  ///< how often a vertex has moved
  bool floats_;
  Vec3 centre_{};
  std::priority_queue<Contraction> queue_;
  std::vector<std::uint32_t> around_, near_;
};

void require_manifold(const TriangleMesh& mesh, const RunContext& run) {
  const CheckReport r = check_mesh(mesh, run);
  if (r.manifold()) return;
  throw Error(ExitCode::unreadable,
              fmt::format("simplify: the mesh is not manifold ({} edges, {} vertices, {} edges between triangles of "
                          "opposite sides, {} triangles there twice, {} without three vertices); 'lamina check' tells "
                          "more",
                          r.non_manifold_edges, r.non_manifold_vertices, r.inconsistent_edges, r.duplicate_triangles,
                          r.repeated_index_triangles));
}

}  // namespace

SimplifyStats simplify_mesh(TriangleMesh& mesh, const SimplifySettings& settings, const RunContext& run) {
  if (settings.triangles == 0) throw Error(ExitCode::usage, "simplify: at least one triangle has to stay");
  require_manifold(mesh, run);
  if (settings.triangles > mesh.triangles.size()) {
    throw Error(ExitCode::usage, fmt::format("simplify: {} triangles are wanted, the mesh has {}", settings.triangles,
                                             mesh.triangles.size()));
  }
  Simplifier simplifier(mesh);
  const SimplifyStats stats = simplifier.run(settings.triangles, run);
  simplifier.finish();
  return stats;
}

}  // namespace lamina
