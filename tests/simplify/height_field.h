// Meshes over the unit square, for tests of simplification.
#pragma once
#include <cstdint>

#include "lamina/mesh.h"

namespace lamina::test {

/// n x n squares, two triangles each, at height(x, y).
template <class Height>
TriangleMesh height_field(std::uint32_t n, const Height& height) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i <= n; ++i) {
    for (std::uint32_t j = 0; j <= n; ++j) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      mesh.positions.push_back({x, y, height(x, y)});
    }
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return mesh;
}

}  // namespace lamina::test
