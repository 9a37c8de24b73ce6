#include "lamina/measure.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/hashing.h"
#include "base/run.h"
#include "base/union_find.h"
#include "lamina/error.h"
#include "measure/edge_table.h"
#include "measure/triangle_bvh.h"
#include "meshes/vec3.h"

namespace lamina {
namespace {

using namespace measure;
using namespace meshes;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Work {
  const TriangleMesh& mesh;
  UnionFind components;
  std::vector<std::uint8_t> used, on_boundary;  ///< vertices
  std::vector<double> angles;                   ///< sum around each vertex
  std::vector<std::uint32_t> part_of;           ///< component's root -> part

  explicit Work(const TriangleMesh& m)
      : mesh(m),
        components(m.positions.size()),
        used(m.positions.size()),
        on_boundary(m.positions.size()),
        angles(m.positions.size()),
        part_of(m.positions.size()) {}
  [[nodiscard]] Vec3 normal(std::uint32_t triangle) const { return area_normal(mesh, triangle); }
};

void widen(Vec3& low, Vec3& high, const Vec3& p) {
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::min(low[k], p[k]);
    high[k] = std::max(high[k], p[k]);
  }
}

void look_at_vertices(Work& w, MeshMeasures& m) {
  m.low = {kInfinity, kInfinity, kInfinity};
  m.high = {-kInfinity, -kInfinity, -kInfinity};
  for (const auto& t : w.mesh.triangles) {
    if (repeats_index(t)) continue;
    ++m.triangles;
    w.components.unite(t[0], t[1]);
    w.components.unite(t[1], t[2]);
    for (const auto v : t) w.used[v] = 1;
  }
  if (m.triangles == 0) throw Error(ExitCode::unreadable, "measure: the mesh has no triangles (a point cloud?)");
  for (std::uint32_t v = 0; v < w.used.size(); ++v) {
    if (w.used[v] == 0) continue;
    const Vec3& p = w.mesh.positions[v];
    if (!std::isfinite(p[0] + p[1] + p[2]))
      throw Error(ExitCode::unreadable,
                  fmt::format("measure: vertex {} is not finite; drop_non_finite() leaves it out", v));
    ++m.vertices;
    widen(m.low, m.high, p);
    if (w.components.find(v) != v) continue;
    w.part_of[v] = static_cast<std::uint32_t>(m.parts.size());
    m.parts.push_back({.closed = true, .low = p, .high = p});
  }
}

/// Area, volume, angles. Volumes are those of tetrahedra with a corner in the middle of the box, where they cancel
/// least.
void look_at_triangles(Work& w, MeshMeasures& m) {
  const Vec3 middle = 0.5 * (m.low + m.high);
  Vec3 moment{};
  for (const auto& t : w.mesh.triangles) {
    if (repeats_index(t)) continue;
    std::array<Vec3, 3> p{};
    for (std::size_t k = 0; k < 3; ++k) p[k] = w.mesh.positions[t[k]] - middle;
    const double area = triangle_area(p[0], p[1], p[2]);
    MeshPart& part = m.parts[w.part_of[w.components.find(t[0])]];
    ++part.triangles;
    part.area += area;
    part.volume += dot(p[0], cross(p[1], p[2])) / 6;
    for (const auto v : t) widen(part.low, part.high, w.mesh.positions[v]);
    m.area += area;
    moment = moment + (area / 3) * (p[0] + p[1] + p[2]);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 a = p[(k + 1) % 3] - p[k], b = p[(k + 2) % 3] - p[k];
      w.angles[t[k]] += std::atan2(norm(cross(a, b)), dot(a, b));
    }
  }
  m.centroid = m.area > 0 ? middle + (1 / m.area) * moment : middle;
}

/// An edge's share of the integral of the mean curvature is half its length times its dihedral angle.
void look_at_edges(Work& w, MeshMeasures& m) {
  m.shortest_edge = kInfinity;
  double sum = 0, bending = 0;
  EdgeTable(w.mesh).for_each_edge([&](std::span<const Side> sides) {
    const auto& first = w.mesh.triangles[sides[0].corner / 3];
    const std::uint32_t a = first[sides[0].corner % 3], b = first[sides[0].next_corner() % 3];
    const double length = norm(w.mesh.positions[b] - w.mesh.positions[a]);
    ++m.edges;
    sum += length;
    m.shortest_edge = std::min(m.shortest_edge, length);
    m.longest_edge = std::max(m.longest_edge, length);
    bool opposite = sides.size() == 2;
    if (opposite) {
      const auto& second = w.mesh.triangles[sides[1].corner / 3];
      opposite = second[sides[1].corner % 3] == b;
    }
    if (sides.size() == 1) {
      ++m.boundary_edges;
      m.boundary_length += length;
      w.on_boundary[a] = w.on_boundary[b] = 1;
    }
    if (!opposite) {
      m.parts[w.part_of[w.components.find(a)]].closed = false;
      return;
    }
    const Vec3 n0 = w.normal(sides[0].corner / 3), n1 = w.normal(sides[1].corner / 3);
    bending += 0.5 * length * std::atan2(norm(cross(n0, n1)), dot(n0, n1));
  });
  m.mean_edge = sum / static_cast<double>(m.edges);
  m.mean_absolute_mean_curvature = m.area > 0 ? bending / m.area : 0;
}

}  // namespace

MeshMeasures measure_mesh(const TriangleMesh& mesh, const RunContext& run) {
  if (mesh.triangles.size() > 0xFFFFFFFFU / 3)
    throw Error(ExitCode::unreadable, "measure: meshes of more than 1,431,655,765 triangles are not supported");
  Work work(mesh);
  MeshMeasures m;
  look_at_vertices(work, m);
  look_at_triangles(work, m);
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  look_at_edges(work, m);
  for (std::size_t v = 0; v < work.used.size(); ++v) {
    if (work.used[v] != 0 && work.on_boundary[v] == 0)
      m.total_gaussian_curvature += 2 * std::numbers::pi - work.angles[v];
  }
  double volume = 0;
  bool closed = true;
  for (MeshPart& part : m.parts) {
    if (!part.closed) part.volume = 0;
    closed = closed && part.closed;
    volume += part.volume;
  }
  if (closed) m.volume = volume;
  std::stable_sort(m.parts.begin(), m.parts.end(),
                   [](const MeshPart& a, const MeshPart& b) { return a.area > b.area; });
  return m;
}

namespace {

using namespace meshes;

/// Samples of one side by number: stratified by area on a mesh, the points themselves of a cloud.
class SideSampler {
 public:
  SideSampler(const TriangleMesh& mesh, const CompareSettings& settings, std::uint64_t stream)
      : mesh_(mesh),
        areas_(mesh),
        seed_(settings.seed * 2 + stream),
        count_(mesh.triangles.empty() ? mesh.positions.size() : settings.count) {
    if (settings.vertices && !mesh.triangles.empty()) list_vertices();
    if (!mesh.triangles.empty() && !(areas_.total_area() > 0))
      throw Error(ExitCode::unreadable, "compare: a mesh whose triangles have no area cannot be sampled");
  }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] Vec3 at(std::uint64_t i) const {
    if (mesh_.triangles.empty()) return mesh_.positions[i];
    if (!vertices_.empty()) return mesh_.positions[vertices_[i]];
    CounterRng rng(seed_, i);
    const double u = (static_cast<double>(i) + rng.uniform()) / static_cast<double>(count_);
    const double v = rng.uniform(), w = rng.uniform();
    return position_at(mesh_, areas_.at(u, v, w));
  }

 private:
  void list_vertices() {
    std::vector<bool> used(mesh_.positions.size(), false);
    for (const auto& t : mesh_.triangles)
      for (const auto v : t) used[v] = true;
    for (std::uint32_t v = 0; v < used.size(); ++v)
      if (used[v]) vertices_.push_back(v);
    count_ = vertices_.size();
  }

  const TriangleMesh& mesh_;
  AreaSampler areas_;
  std::uint64_t seed_, count_;
  std::vector<std::uint32_t> vertices_;  ///< the samples, where these are asked for
};

DistanceStats measure_side(const TriangleMesh& from, const TriangleMesh& to, const CompareSettings& settings,
                           std::uint64_t stream) {
  const SideSampler sampler(from, settings, stream);
  const measure::TriangleBvh tree(to);
  std::vector<double> distances(sampler.count());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, distances.size(), 1024),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i < range.end(); ++i)
                        distances[i] = tree.distance(sampler.at(i));
                    });
  // Summed in ascending order, by one thread: exact to the last bit whatever the threads did.
  std::sort(distances.begin(), distances.end());
  DistanceStats stats;
  stats.samples = distances.size();
  double sum = 0, squares = 0;
  for (const double d : distances) {
    sum += d;
    squares += d * d;
  }
  const auto n = static_cast<double>(distances.size());
  stats.mean = sum / n;
  stats.rms = std::sqrt(squares / n);
  stats.p99 = distances[static_cast<std::size_t>(std::ceil(0.99 * n)) - 1];
  stats.max = distances.back();
  return stats;
}

double diagonal_of(const TriangleMesh& mesh) {
  if (mesh.positions.empty()) return 0;
  measure::Bounds box{mesh.positions[0], mesh.positions[0]};
  if (!mesh.triangles.empty()) {
    box = measure::triangle_bounds(mesh);
  } else {
    for (const auto& p : mesh.positions) widen(box, p);
  }
  return norm(box.high - box.low);
}

}  // namespace

CompareResult compare(const TriangleMesh& a, const TriangleMesh& b, const CompareSettings& settings,
                      const RunContext& run) {
  if (settings.count == 0) throw Error(ExitCode::usage, "compare: --count must be at least 1");
  if (a.triangles.empty() && b.triangles.empty())
    throw Error(ExitCode::unreadable, "compare: neither side has triangles; one of the two must be a mesh");
  CompareResult result;
  result.diagonal = diagonal_of(b);
  with_threads(run.threads, [&] {
    if (!b.triangles.empty()) result.a_to_b = measure_side(a, b, settings, 0);
    if (!a.triangles.empty()) result.b_to_a = measure_side(b, a, settings, 1);
  });
  return result;
}

}  // namespace lamina
