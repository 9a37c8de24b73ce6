#include "simplify/part.h"

#include <cstddef>
#include <span>
#include <utility>

#include "measure/edge_table.h"
#include "simplify/rounds.h"
#include "simplify/stars.h"

namespace lamina::simplify {
namespace {

/// Is the vertex a side begins with the same for both of an edge? Then their triangles face opposite sides.
bool same_direction(const TriangleMesh& mesh, const measure::Side& a, const measure::Side& b) {
  return mesh.triangles[a.corner / 3][a.corner % 3] == mesh.triangles[b.corner / 3][b.corner % 3];
}

/// Contractions know manifolds only.
void lock_non_manifold(const TriangleMesh& mesh, const measure::EdgeTable& edges, std::vector<std::uint8_t>& locked) {
  std::vector<std::uint8_t> rims(mesh.positions.size(), 0);  // edges of one triangle at a vertex, up to 3
  edges.for_each_edge([&](std::span<const measure::Side> sides) {
    const std::uint32_t corner = sides[0].corner;
    const auto& t = mesh.triangles[corner / 3];
    const bool wrong = sides.size() > 2 || (sides.size() == 2 && same_direction(mesh, sides[0], sides[1]));
    for (const std::uint32_t v : {t[corner % 3], t[sides[0].next_corner() % 3]}) {
      if (wrong) locked[v] = 1;
      if (sides.size() == 1 && rims[v] < 3) ++rims[v];
    }
  });
  for (std::size_t v = 0; v < rims.size(); ++v) {
    if (rims[v] > 2) locked[v] = 1;
  }
}

}  // namespace

std::vector<std::uint32_t> drop_unused(TriangleMesh& mesh) {
  std::vector<std::uint32_t> number(mesh.positions.size(), kNone);
  for (const auto& t : mesh.triangles) {
    for (const std::uint32_t v : t) number[v] = 0;
  }
  std::uint32_t kept = 0;
  for (std::uint32_t v = 0; v < number.size(); ++v) {
    if (number[v] == kNone) continue;
    number[v] = kept;
    mesh.positions[kept] = mesh.positions[v];
    if (!mesh.normals.empty()) mesh.normals[kept] = mesh.normals[v];
    for (auto& values : mesh.attributes) values[kept] = values[v];
    ++kept;
  }
  mesh.positions.resize(kept);
  if (!mesh.normals.empty()) mesh.normals.resize(kept);
  for (auto& values : mesh.attributes) values.resize(kept);
  for (auto& t : mesh.triangles) {
    for (std::uint32_t& v : t) v = number[v];
  }
  return number;
}

PartResult simplify_part(TriangleMesh& mesh, std::vector<std::uint8_t> locked, std::uint64_t triangles,
                         const RunContext& run) {
  const measure::EdgeTable edges(mesh);
  lock_non_manifold(mesh, edges, locked);
  WorkMesh work = make_work_mesh(mesh, edges);
  work.locked = std::move(locked);
  contract_to(work, triangles, run);
  PartResult result;
  result.deviation = work.deviation;
  result.numbers = drop_unused(mesh);
  return result;
}

}  // namespace lamina::simplify
