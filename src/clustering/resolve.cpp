#include "clustering/resolve.h"

#include <Eigen/Dense>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

// After the mesh: it uses vector_traits without including them.
#include <OpenMesh/Core/Geometry/QuadricT.hh>

#include <algorithm>
#include <atomic>
#include <map>
#include <numeric>

namespace lamina::clustering {
namespace {

template <class T>
std::size_t distinct(std::vector<T>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values.size();
}

std::uint64_t edge_key(std::uint32_t a, std::uint32_t b) {
  return static_cast<std::uint64_t>(std::min(a, b)) << 32 | std::max(a, b);
}

/// Sorted edges: how many are used once.
std::size_t used_once(const std::vector<std::uint64_t>& edges) {
  std::size_t once = 0;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i + 1;
    while (end < edges.size() && edges[end] == edges[i]) ++end;
    once += end - i == 1 ? 1 : 0;
    i = end;
  }
  return once;
}

}  // namespace

bool collapses(std::span<const StarTriangle> star, std::uint64_t own, ComponentScratch& scratch) {
  auto& [inner, outer, labels, members, outside] = scratch;
  inner.clear(), outer.clear(), labels.clear(), members.clear(), outside.clear();
  std::size_t full = 0;            // triangles inside K
  std::size_t ring_steps = 0;      // one vertex in K: a step of the ring from isovertex to isovertex
  std::size_t ring_triangles = 0;  // of these, those that step from component to component
  for (const StarTriangle& t : star) {
    std::size_t in = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t n = (k + 1) % 3;
      const bool a = t.label[k] == own, b = t.label[n] == own;
      if (a && b) inner.push_back(edge_key(t.vertex[k], t.vertex[n]));
      if (a != b) outer.push_back(edge_key(t.vertex[k], t.vertex[n]));
      if (a) {
        ++in;
        members.push_back(t.vertex[k]);
      } else {
        outside.push_back(t.vertex[k]);
        labels.push_back(t.label[k]);
      }
    }
    full += in == 3 ? 1 : 0;
    if (in != 1) continue;
    ++ring_steps;
    ring_triangles += labels.back() != labels[labels.size() - 2] ? 1 : 0;
  }
  const std::size_t neighbours = distinct(labels);
  const std::size_t ring_vertices = distinct(outside);
  std::sort(outer.begin(), outer.end());
  const std::size_t ends = used_once(outer);
  const std::size_t gap = ends == 0 ? 0 : 1;  // a path has one vertex more than steps
  if (ends != 0 && ends != 2) return false;
  if (neighbours != ring_triangles + gap || neighbours < 3 - gap || ring_vertices != ring_steps + gap) return false;
  return distinct(members) + full == distinct(inner) + 1;
}

namespace {

struct PatchTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using PatchMesh = OpenMesh::TriMesh_ArrayKernelT<PatchTraits>;
using Quadric = OpenMesh::Geometry::Quadricd;

/// Singular values below this share of the largest belong to directions the planes do not fix (Lindstrom 2000).
constexpr double kSingularShare = 1e-3;

/// The component's surroundings as a mesh, and which of its vertices are the component's.
struct Patch {
  PatchMesh mesh;
  std::vector<OpenMesh::VertexHandle> members;
};

Patch load(std::span<const PatchTriangle> triangles) {
  Patch patch;
  std::map<std::uint32_t, OpenMesh::VertexHandle> handles;
  for (const PatchTriangle& t : triangles) {
    std::array<OpenMesh::VertexHandle, 3> face;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [it, fresh] = handles.try_emplace(t.vertex[k]);
      if (fresh) {
        it->second = patch.mesh.add_vertex({t.point[k].x(), t.point[k].y(), t.point[k].z()});
        if (t.member[k]) patch.members.push_back(it->second);
      }
      face[k] = it->second;
    }
    patch.mesh.add_face(face[0], face[1], face[2]);
  }
  return patch;
}

std::span<const ClusterTriangle> triangles_of(const SlabRecord& record, const UnresolvedCluster& cluster) {
  return {record.unresolved_triangles.data() + cluster.first, cluster.count};
}

Ref corner_ref(const SlabRecord& record, const UnresolvedCluster& cluster) {
  return slab_tag(record.slab) | cluster.corner;
}

/// Members in mesh order: those of the slab below first.
void list_members(const Window& window, const SlabRecord& record, const UnresolvedCluster& cluster,
                  std::vector<Ref>& members) {
  const Ref own = corner_ref(record, cluster);
  members.clear();
  for (const ClusterTriangle& t : triangles_of(record, cluster)) {
    for (const Ref v : t.vertex) {
      if (window.corner_of(v) == own) members.push_back(v);
    }
  }
  const Ref tag = slab_tag(record.slab);
  std::sort(members.begin(), members.end(), [tag](Ref a, Ref b) {
    const bool a_here = (a & ~kRefIndex) == tag, b_here = (b & ~kRefIndex) == tag;
    return a_here != b_here ? b_here : a < b;
  });
  members.erase(std::unique(members.begin(), members.end()), members.end());
}

std::uint32_t root(std::vector<std::uint32_t>& parent, std::uint32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

std::uint64_t label_of(const Window& window, Ref v) {
  return static_cast<std::uint64_t>(window.corner_of(v)) << 16 | window.vertex(v).component;
}

/// The isovertex relative to `corner`; differences of positions are exact.
Eigen::Vector3d point_of(const Window& window, Ref v, const SurfaceCorner& corner) {
  const SlabRecord& record = window.record_of(v);
  const IsoVertex& vertex = record.iso->vertices[v & kRefIndex];
  const auto corner_at = [&](SlabIndex i) -> const SurfaceCorner& {
    return (i.next() ? window.at(record.slab + 1) : record).iso->corners[i.index()];
  };
  const SurfaceCorner& low = corner_at(vertex.low);
  const SurfaceCorner& high = corner_at(vertex.high);
  Eigen::Vector3d point;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t from = std::int64_t{low.position[axis]} - corner.position[axis];
    const std::int64_t along = std::int64_t{high.position[axis]} - low.position[axis];
    point[static_cast<Eigen::Index>(axis)] =
        static_cast<double>(from) + static_cast<double>(vertex.t) * static_cast<double>(along);
  }
  return point;
}

std::array<float, 3> place(const Window& window, const SlabRecord& record, const UnresolvedCluster& cluster,
                           std::span<const StarTriangle> star, std::uint64_t own) {
  const SurfaceCorner& corner = record.iso->corners[cluster.corner];
  std::vector<PatchTriangle> patch;
  patch.reserve(star.size());
  for (const StarTriangle& t : star) {
    PatchTriangle& p = patch.emplace_back();
    p.vertex = t.vertex;
    for (std::size_t k = 0; k < 3; ++k) {
      p.point[k] = point_of(window, t.vertex[k], corner);
      p.member[k] = t.label[k] == own;
    }
  }
  const Eigen::Vector3f position = place_patch(patch).cast<float>();
  return {position.x(), position.y(), position.z()};
}

}  // namespace

Eigen::Vector3d place_patch(std::span<const PatchTriangle> triangles) {
  const Patch patch = load(triangles);
  OpenMesh::Vec3d sum(0.0);
  for (const auto member : patch.members) sum += patch.mesh.point(member);
  sum /= static_cast<double>(std::max<std::size_t>(patch.members.size(), 1));
  Eigen::Vector3d mean(sum[0], sum[1], sum[2]);

  Quadric quadric;  // about the mean: small numbers, and the solution of least norm is the one nearest to it
  for (const auto face : patch.mesh.faces()) {
    std::array<OpenMesh::Vec3d, 3> p;
    std::size_t k = 0;
    for (const auto vertex : patch.mesh.fv_range(face)) p[k++] = patch.mesh.point(vertex) - sum;
    const OpenMesh::Vec3d normal = OpenMesh::cross(p[1] - p[0], p[2] - p[0]);  // its length carries the weight
    quadric += Quadric(normal, p[0]);
  }
  Eigen::Matrix3d a;
  a << quadric.xx(), quadric.xy(), quadric.xz(),  //
      quadric.xy(), quadric.yy(), quadric.yz(),   //
      quadric.xz(), quadric.yz(), quadric.zz();
  const Eigen::Vector3d b(-quadric.xw(), -quadric.yw(), -quadric.zw());
  Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  svd.setThreshold(kSingularShare);
  const Eigen::Vector3d shift = svd.solve(b);

  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();
  for (const auto vertex : patch.mesh.vertices()) {
    const OpenMesh::Vec3d p = patch.mesh.point(vertex) - sum;
    low = low.cwiseMin(Eigen::Vector3d(p[0], p[1], p[2]));
    high = high.cwiseMax(Eigen::Vector3d(p[0], p[1], p[2]));
  }
  if (!shift.allFinite()) return mean;
  return mean + shift.cwiseMax(0.5 * low).cwiseMin(0.5 * high);
}

void split_components(Window& window, const SlabRecord& record, UnresolvedCluster& cluster, ResolveScratch& scratch) {
  std::vector<Ref>& members = scratch.members;
  std::vector<std::uint32_t>& parent = scratch.parent;
  list_members(window, record, cluster, members);
  const auto index_of = [&](Ref v) {
    return static_cast<std::uint32_t>(std::find(members.begin(), members.end(), v) - members.begin());
  };
  parent.resize(members.size());
  std::iota(parent.begin(), parent.end(), 0U);
  for (const ClusterTriangle& t : triangles_of(record, cluster)) {
    std::uint32_t first = kNone;
    for (const Ref v : t.vertex) {
      const std::uint32_t i = index_of(v);
      if (i == members.size()) continue;
      if (first != kNone)
        parent[std::max(root(parent, i), root(parent, first))] = std::min(root(parent, i), root(parent, first));
      first = i;
    }
  }
  std::uint16_t components = 0;
  for (std::uint32_t i = 0; i < members.size(); ++i) {  // a root is its component's smallest member
    const std::uint32_t r = root(parent, i);
    window.vertex(members[i]).component = r == i ? components++ : window.vertex(members[r]).component;
  }
  cluster.components.assign(components, {});
}

void veto_neighbours(Window& window, const SlabRecord& record, const UnresolvedCluster& cluster,
                     ResolveScratch& scratch) {
  const Ref own = corner_ref(record, cluster);
  std::vector<std::uint64_t>& steps =
      scratch.steps;  // neighbour cluster and the vertex of this one that begins a step of its ring
  steps.clear();
  for (const ClusterTriangle& t : triangles_of(record, cluster)) {
    const std::array<Ref, 3> corner{window.corner_of(t.vertex[0]), window.corner_of(t.vertex[1]),
                                    window.corner_of(t.vertex[2])};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t after = (k + 1) % 3, before = (k + 2) % 3;
      if (corner[k] == own || corner[after] != own || corner[before] == corner[k]) continue;
      steps.push_back(static_cast<std::uint64_t>(corner[k]) << 32 | t.vertex[after]);
    }
  }
  std::sort(steps.begin(), steps.end());
  for (auto it = std::adjacent_find(steps.begin(), steps.end()); it != steps.end();
       it = std::adjacent_find(it + 1, steps.end())) {
    const auto corner = static_cast<Ref>(*it >> 32);
    std::uint8_t& veto = window.record_of(corner).vetoes[corner & kRefIndex];
    std::atomic_ref<std::uint8_t>(veto).store(1, std::memory_order_relaxed);
  }
}

Verdict resolve(const Window& window, const SlabRecord& record, UnresolvedCluster& cluster, ResolveScratch& scratch) {
  const Ref corner = corner_ref(record, cluster);
  std::vector<StarTriangle>&all = scratch.all, &star = scratch.star;
  all.clear();
  for (const ClusterTriangle& t : triangles_of(record, cluster)) {
    StarTriangle& s = all.emplace_back();
    s.vertex = t.vertex;
    for (std::size_t k = 0; k < 3; ++k) s.label[k] = label_of(window, t.vertex[k]);
  }
  bool any = false;
  for (std::size_t component = 0; component < cluster.components.size(); ++component) {
    const std::uint64_t own = static_cast<std::uint64_t>(corner) << 16 | component;
    star.clear();
    std::copy_if(all.begin(), all.end(), std::back_inserter(star),
                 [own](const StarTriangle& t) { return t.label[0] == own || t.label[1] == own || t.label[2] == own; });
    if (!collapses(star, own, scratch.component)) continue;
    any = true;
    cluster.components[component].collapses = true;
    if (cluster.components.size() > 1)
      cluster.components[component].position = place(window, record, cluster, star, own);
  }
  if (!any) return Verdict::kept;
  return cluster.components.size() == 1 ? Verdict::corner : Verdict::split;
}

}  // namespace lamina::clustering
