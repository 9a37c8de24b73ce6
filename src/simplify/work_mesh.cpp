#include "simplify/work_mesh.h"

#include <algorithm>
#include <cstddef>
#include <span>

namespace lamina::simplify {

using namespace meshes;

namespace {

constexpr double kBoundaryWeight = 1;  ///< of planes through boundary edges, beside the squared edge

/// Of a corner of a work mesh, about its centre.
Vec3 local_place(const WorkMesh& work, std::uint32_t v) {
  return work.mesh.positions[v] - work.centre;
}
Vec3 local_normal(const WorkMesh& work, const Triangle& t) {
  const Vec3 a = local_place(work, t[0]);
  return cross(local_place(work, t[1]) - a, local_place(work, t[2]) - a);
}

}  // namespace

WorkMesh begin_work_mesh(TriangleMesh& mesh) {
  WorkMesh work{mesh, std::vector<Quadric>(mesh.positions.size())};
  Vec3 low = mesh.positions[mesh.triangles[0][0]], high = low;
  work.floats = true;
  for (const Triangle& t : mesh.triangles) {
    for (const std::uint32_t v : t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const double c = mesh.positions[v][k];
        low[k] = std::min(low[k], c);
        high[k] = std::max(high[k], c);
        work.floats = work.floats && static_cast<double>(static_cast<float>(c)) == c;
      }
    }
  }
  work.centre = 0.5 * (low + high);
  return work;
}

void add_planes(WorkMesh& work) {
  for (const Triangle& t : work.mesh.triangles) {
    const Vec3 n = local_normal(work, t);
    const double twice = norm(n);
    if (!(twice > 0)) continue;
    const Quadric plane = plane_quadric(local_place(work, t[0]), (1 / twice) * n, 0.5 * twice, kNormalNoise);
    for (const std::uint32_t v : t) work.quadrics[v] += plane;
  }
}

void add_walls(WorkMesh& work, const measure::EdgeTable& edges) {
  edges.for_each_edge([&](std::span<const measure::Side> sides) {
    if (sides.size() != 1) return;
    const std::uint32_t corner = sides[0].corner;
    const Triangle& t = work.mesh.triangles[corner / 3];
    const std::uint32_t u = t[corner % 3], v = t[sides[0].next_corner() % 3];
    if (!work.locked.empty() && work.locked[u] != 0 && work.locked[v] != 0) return;
    const Vec3 edge = local_place(work, v) - local_place(work, u), n = local_normal(work, t);
    if (!(norm(n) > 0)) return;
    const Quadric wall = plane_quadric(local_place(work, u), unit(cross(edge, unit(n))),
                                       kBoundaryWeight * dot(edge, edge), kNormalNoise);
    work.quadrics[u] += wall;
    work.quadrics[v] += wall;
  });
}

WorkMesh make_work_mesh(TriangleMesh& mesh, const measure::EdgeTable& edges) {
  WorkMesh work = begin_work_mesh(mesh);
  add_planes(work);
  add_walls(work, edges);
  return work;
}

}  // namespace lamina::simplify
