// Small shapes to draw.
#pragma once
#include <cmath>
#include <numbers>

#include "lamina/mesh.h"

namespace lamina::test {

/// A sphere of latitudes and longitudes, closed, counter-clockwise from outside, without normals.
inline TriangleMesh sphere(double radius, std::uint32_t rings, std::array<double, 3> centre = {}) {
  TriangleMesh mesh;
  const std::uint32_t around = 2 * rings;
  mesh.positions.push_back({centre[0], centre[1], centre[2] + radius});
  for (std::uint32_t i = 1; i < rings; ++i) {
    for (std::uint32_t j = 0; j < around; ++j) {
      const double theta = std::numbers::pi * i / rings, phi = 2 * std::numbers::pi * j / around;
      mesh.positions.push_back({centre[0] + radius * std::sin(theta) * std::cos(phi),
                                centre[1] + radius * std::sin(theta) * std::sin(phi),
                                centre[2] + radius * std::cos(theta)});
    }
  }
  mesh.positions.push_back({centre[0], centre[1], centre[2] - radius});
  const auto at = [&](std::uint32_t i, std::uint32_t j) { return 1 + (i - 1) * around + j % around; };
  const auto last = static_cast<std::uint32_t>(mesh.positions.size() - 1);
  for (std::uint32_t j = 0; j < around; ++j) {
    mesh.triangles.push_back({0, at(1, j), at(1, j + 1)});
    mesh.triangles.push_back({last, at(rings - 1, j + 1), at(rings - 1, j)});
    for (std::uint32_t i = 1; i + 1 < rings; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

/// A square in the plane z = height, facing +z, with a colour of type `type` (channels in the type's own range).
inline TriangleMesh square(double side, double height, std::array<float, 3> colour,
                           ScalarType type = ScalarType::uint8) {
  TriangleMesh mesh;
  const double h = side / 2;
  mesh.positions = {{-h, -h, height}, {h, -h, height}, {h, h, height}, {-h, h, height}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.layout = {{"red", type}, {"green", type}, {"blue", type}};
  for (const float c : colour) mesh.attributes.emplace_back(4, c);
  return mesh;
}

}  // namespace lamina::test
