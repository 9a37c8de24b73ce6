#include "lamina/measure.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "base/run.h"
#include "base/union_find.h"
#include "lamina/error.h"
#include "measure/edge_table.h"
#include "meshes/vec3.h"

namespace lamina {
namespace {

using namespace measure;
using namespace meshes;

/// Size of a hash table for n entries: a power of two at least twice n, entry 0 free.
std::size_t table_size(std::size_t n) {
  return std::bit_ceil(std::max<std::size_t>(16, 2 * n));
}

std::uint64_t mix(std::uint64_t h, std::uint64_t v) {
  h = (h ^ v) * 0x9E3779B97F4A7C15ull;
  return h ^ (h >> 29);
}

/// Counts entries equal to an earlier one by open addressing; `hash(i)`, `equal(i, j)`.
template <class Hash, class Equal>
class DuplicateCounter {
 public:
  DuplicateCounter(std::size_t n, Hash hash, Equal equal) : slots_(table_size(n)), hash_(hash), equal_(equal) {}
  void add(std::uint32_t i) {
    const std::size_t mask = slots_.size() - 1;
    for (std::size_t s = hash_(i) & mask;; s = (s + 1) & mask) {
      if (slots_[s] == 0) {
        slots_[s] = i + 1;
        return;
      }
      if (equal_(slots_[s] - 1, i)) {
        ++count;
        return;
      }
    }
  }
  std::uint64_t count = 0;

 private:
  std::vector<std::uint32_t> slots_;  ///< index + 1
  Hash hash_;
  Equal equal_;
};

/// Vertices at the exact position of an earlier one (0 and -0 are the same; a NaN equals nothing).
std::uint64_t count_duplicate_vertices(const TriangleMesh& mesh) {
  const auto& p = mesh.positions;
  const auto hash = [&](std::uint32_t i) {
    std::uint64_t h = 0;
    for (const double c : p[i]) h = mix(h, std::bit_cast<std::uint64_t>(c + 0.0));  // -0 becomes 0
    return h;
  };
  const auto is_nan = [&](std::uint32_t i) {
    return std::any_of(p[i].begin(), p[i].end(), [](double c) { return std::isnan(c); });
  };
  DuplicateCounter counter(p.size(), hash, [&](std::uint32_t a, std::uint32_t b) { return p[a] == p[b]; });
  for (std::uint32_t i = 0; i < p.size(); ++i)
    if (!is_nan(i)) counter.add(i);
  return counter.count;
}

/// Triangles that name the same three vertices as an earlier one, in any order; those that repeat an index do not
/// count.
std::uint64_t count_duplicate_triangles(const TriangleMesh& mesh) {
  const auto sorted = [&](std::uint32_t i) {
    auto t = mesh.triangles[i];
    std::sort(t.begin(), t.end());
    return t;
  };
  const auto hash = [&](std::uint32_t i) {
    std::uint64_t h = 0;
    for (const auto v : sorted(i)) h = mix(h, v + 1u);
    return h;
  };
  DuplicateCounter counter(mesh.triangles.size(), hash,
                           [&](std::uint32_t a, std::uint32_t b) { return sorted(a) == sorted(b); });
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
    if (!repeats_index(mesh.triangles[i])) counter.add(i);
  return counter.count;
}

void check_vertices(const TriangleMesh& mesh, CheckReport& r) {
  for (const auto& p : mesh.positions)
    if (!std::all_of(p.begin(), p.end(), [](double c) { return std::isfinite(c); })) ++r.non_finite_vertices;
  r.duplicate_vertices = count_duplicate_vertices(mesh);
}

void check_triangles(const TriangleMesh& mesh, CheckReport& r) {
  for (const auto& t : mesh.triangles) {
    if (repeats_index(t)) {
      ++r.repeated_index_triangles;
      continue;
    }
    const Vec3 a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    const double longest = std::max({norm(b - a), norm(c - b), norm(a - c)});
    if (norm(area_normal(a, b, c)) <= 1e-12 * longest * longest) ++r.zero_area_triangles;
  }
  r.duplicate_triangles = count_duplicate_triangles(mesh);
}

/// Joins triangles at each edge they share and keeps the edges of one triangle.
struct Topology {
  UnionFind fans;        ///< over triangle corners: those of one vertex joined through shared edges
  UnionFind components;  ///< over vertices
  std::vector<Side> boundary;
};

Topology walk_edges(const TriangleMesh& mesh, CheckReport& r) {
  Topology topology{UnionFind(3 * mesh.triangles.size()), UnionFind(mesh.positions.size()), {}};
  const auto vertex = [&](std::uint32_t corner) { return mesh.triangles[corner / 3][corner % 3]; };
  EdgeTable(mesh).for_each_edge([&](std::span<const Side> sides) {
    ++r.edges;
    const Side& first = sides[0];
    topology.components.unite(vertex(first.corner), vertex(first.next_corner()));
    if (sides.size() == 1) topology.boundary.push_back(first);
    if (sides.size() > 2) ++r.non_manifold_edges;
    for (const Side& other : sides.subspan(1)) {
      const bool opposite = vertex(other.corner) == vertex(first.next_corner());
      if (!opposite && sides.size() == 2) ++r.inconsistent_edges;
      topology.fans.unite(first.corner, opposite ? other.next_corner() : other.corner);
      topology.fans.unite(first.next_corner(), opposite ? other.corner : other.next_corner());
    }
  });
  return topology;
}

void check_fans(const TriangleMesh& mesh, Topology& topology, CheckReport& r) {
  enum : std::uint8_t { kUnseen, kInTriangle, kOneFan, kMoreFans };
  std::vector<std::uint8_t> state(mesh.positions.size(), kUnseen);
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
    for (std::uint32_t k = 0; k < 3; ++k) {
      auto& s = state[mesh.triangles[i][k]];
      s = std::max<std::uint8_t>(s, kInTriangle);
      if (!repeats_index(mesh.triangles[i]) && topology.fans.find(3 * i + k) == 3 * i + k)
        s = s < kOneFan ? kOneFan : kMoreFans;
    }
  std::int64_t in_surface = 0;
  for (const auto s : state) {
    r.unreferenced_vertices += s == kUnseen;
    r.non_manifold_vertices += s == kMoreFans;
    in_surface += s >= kOneFan;
  }
  r.euler_characteristic = in_surface - static_cast<std::int64_t>(r.edges) +
                           static_cast<std::int64_t>(r.triangles - r.repeated_index_triangles);
}

void check_components(const TriangleMesh& mesh, Topology& topology, CheckReport& r) {
  std::vector<std::uint32_t> triangles(mesh.positions.size());
  for (const auto& t : mesh.triangles)
    if (!repeats_index(t)) ++triangles[topology.components.find(t[0])];
  const auto largest = std::max_element(triangles.begin(), triangles.end());
  r.components =
      static_cast<std::uint64_t>(std::count_if(triangles.begin(), triangles.end(), [](auto n) { return n > 0; }));
  r.largest_component_triangles = *largest;
  const auto root = static_cast<std::uint32_t>(largest - triangles.begin());
  for (const Side& s : topology.boundary)
    r.largest_component_boundary_edges += topology.components.find(mesh.triangles[s.corner / 3][0]) == root;
}

/// A boundary edge leads from fan to fan; where the mesh is manifold every fan has one coming and one going.
void check_loops(const TriangleMesh& mesh, Topology& topology, CheckReport& r) {
  r.boundary_edges = topology.boundary.size();
  std::vector<std::uint32_t> fans;
  for (const Side& s : topology.boundary)
    for (const auto corner : {s.corner, s.next_corner()}) fans.push_back(topology.fans.find(corner));
  std::vector<std::uint32_t> ids = fans;
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  for (auto& f : fans) f = static_cast<std::uint32_t>(std::lower_bound(ids.begin(), ids.end(), f) - ids.begin());
  UnionFind loops(ids.size());
  for (std::size_t i = 0; i < fans.size(); i += 2) loops.unite(fans[i], fans[i + 1]);
  struct Loop {
    std::uint64_t edges = 0;
    double length = 0;
    auto operator<=>(const Loop&) const = default;
  };
  std::vector<Loop> found(ids.size());
  for (std::size_t i = 0; i < topology.boundary.size(); ++i) {
    const Side& s = topology.boundary[i];
    const auto& t = mesh.triangles[s.corner / 3];
    Loop& loop = found[loops.find(fans[2 * i])];
    ++loop.edges;
    loop.length += norm(mesh.positions[t[s.next_corner() % 3]] - mesh.positions[t[s.corner % 3]]);
  }
  Loop longest;
  for (const Loop& loop : found) {
    r.boundary_loops += loop.edges > 0;
    if (loop > longest) longest = loop;
  }
  r.longest_loop_edges = longest.edges;
  r.longest_loop_length = longest.length;
}

CheckReport check(const TriangleMesh& mesh) {
  CheckReport r;
  r.vertices = mesh.positions.size();
  r.triangles = mesh.triangles.size();
  check_vertices(mesh, r);
  check_triangles(mesh, r);
  Topology topology = walk_edges(mesh, r);
  check_fans(mesh, topology, r);
  check_components(mesh, topology, r);
  check_loops(mesh, topology, r);
  if (r.closed()) r.genus = static_cast<std::int64_t>(r.components) - r.euler_characteristic / 2;
  return r;
}

}  // namespace

CheckReport check_mesh(const TriangleMesh& mesh, const RunContext& run) {
  if (mesh.triangles.empty()) throw Error(ExitCode::unreadable, "check: the mesh has no triangles (a point cloud?)");
  if (mesh.triangles.size() > 0xFFFFFFFFu / 3)
    throw Error(ExitCode::unreadable, "check: meshes of more than 1,431,655,765 triangles are not supported");
  CheckReport report;
  with_threads(run.threads, [&] { report = check(mesh); });
  return report;
}

}  // namespace lamina
