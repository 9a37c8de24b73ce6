#include "edit/compact.h"

#include <algorithm>

namespace lamina::edit {

TriangleMesh only_vertices(const TriangleMesh& mesh, const std::vector<std::uint8_t>& keep) {
  TriangleMesh out;
  out.layout = mesh.layout;
  out.attributes.resize(mesh.attributes.size());
  std::vector<std::uint32_t> number(mesh.positions.size());
  for (std::size_t v = 0; v < keep.size(); ++v) {
    if (keep[v] == 0) continue;
    number[v] = static_cast<std::uint32_t>(out.positions.size());
    out.positions.push_back(mesh.positions[v]);
    if (!mesh.normals.empty()) out.normals.push_back(mesh.normals[v]);
    for (std::size_t a = 0; a < mesh.attributes.size(); ++a) out.attributes[a].push_back(mesh.attributes[a][v]);
  }
  for (const auto& t : mesh.triangles) {
    if (std::all_of(t.begin(), t.end(), [&](auto v) { return keep[v] != 0; }))
      out.triangles.push_back({number[t[0]], number[t[1]], number[t[2]]});
  }
  return out;
}

TriangleMesh without_unused_vertices(TriangleMesh mesh) {
  std::vector<std::uint8_t> used(mesh.positions.size());
  for (const auto& t : mesh.triangles)
    for (const auto v : t) used[v] = 1;
  if (std::find(used.begin(), used.end(), 0) == used.end()) return mesh;
  return only_vertices(mesh, used);
}

}  // namespace lamina::edit
