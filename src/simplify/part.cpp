#include "simplify/part.h"

#include <cstddef>

#include "simplify/stars.h"

namespace lamina::simplify {

void keep_vertices(TriangleMesh& mesh, std::span<const std::uint8_t> stays) {
  const auto keep = [&](auto& values) {
    std::size_t kept = 0;
    for (std::size_t v = 0; v < values.size(); ++v) {
      if (stays[v] != 0) values[kept++] = values[v];
    }
    values.resize(kept);
  };
  keep(mesh.positions);
  keep(mesh.normals);
  for (auto& values : mesh.attributes) keep(values);
}

std::vector<std::uint32_t> drop_unused(TriangleMesh& mesh) {
  std::vector<std::uint8_t> used(mesh.positions.size());
  for (const auto& t : mesh.triangles) {
    for (const std::uint32_t v : t) used[v] = 1;
  }
  std::vector<std::uint32_t> number(used.size(), kNone);
  std::uint32_t kept = 0;
  for (std::size_t v = 0; v < used.size(); ++v) {
    if (used[v] != 0) number[v] = kept++;
  }
  keep_vertices(mesh, used);
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
