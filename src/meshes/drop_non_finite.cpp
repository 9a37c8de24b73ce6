#include <cmath>
#include <limits>

#include "lamina/mesh.h"

namespace lamina {
namespace {

bool is_finite(const std::array<double, 3>& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

}  // namespace

std::size_t drop_non_finite(TriangleMesh& mesh) {
  constexpr std::uint32_t kGone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> place(mesh.positions.size(), kGone);
  std::uint32_t kept = 0;
  for (std::size_t v = 0; v < place.size(); ++v) {
    if (!is_finite(mesh.positions[v])) continue;
    place[v] = kept;
    mesh.positions[kept] = mesh.positions[v];
    if (!mesh.normals.empty()) mesh.normals[kept] = mesh.normals[v];
    for (auto& values : mesh.attributes) values[kept] = values[v];
    ++kept;
  }
  const std::size_t dropped = place.size() - kept;
  if (dropped == 0) return 0;
  mesh.positions.resize(kept);
  if (!mesh.normals.empty()) mesh.normals.resize(kept);
  for (auto& values : mesh.attributes) values.resize(kept);
  std::erase_if(mesh.triangles, [&](auto& triangle) {
    for (std::uint32_t& v : triangle) v = place[v];
    return triangle[0] == kGone || triangle[1] == kGone || triangle[2] == kGone;
  });
  return dropped;
}

}  // namespace lamina
