#include "clustering/patch.h"

#include <Eigen/Dense>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
// After the mesh: it uses vector_traits without including them.
#include <OpenMesh/Core/Geometry/QuadricT.hh>
#include <algorithm>
#include <map>

namespace lamina::clustering {
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

}  // namespace lamina::clustering
