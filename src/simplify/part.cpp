#include "simplify/part.h"

#include <cstddef>

#include "simplify/stars.h"

namespace lamina::simplify {

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

PartResult PartSimplifier::simplify(TriangleMesh& mesh, std::span<const std::uint8_t> locked, std::uint64_t triangles,
                                    const RunContext& run) {
  PartResult result;
  result.deviation = matchings_.local().reduce(mesh, locked, triangles, run).deviation;
  result.numbers = drop_unused(mesh);
  return result;
}

}  // namespace lamina::simplify
