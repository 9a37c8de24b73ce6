#include "lamina/measure.h"

#include <gtest/gtest.h>

#include <numbers>

#include "render/shapes.h"

namespace lamina {
namespace {

using test::sphere;

constexpr double kPi = std::numbers::pi;

/// Side 2 about a centre, 12 triangles, counter-clockwise from outside.
TriangleMesh cube(const std::array<double, 3>& centre) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.positions.push_back({centre[0] + ((i & 1) != 0 ? 1 : -1), centre[1] + ((i & 2) != 0 ? 1 : -1),
                              centre[2] + ((i & 4) != 0 ? 1 : -1)});
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TEST(MeasureMesh, KnowsTheCubeFarFromTheOrigin) {
  const MeshMeasures m = measure_mesh(cube({500000, 5800000, 100}));
  EXPECT_EQ(m.vertices, 8U);
  EXPECT_EQ(m.edges, 18U);
  EXPECT_NEAR(m.area, 24, 1e-9);
  EXPECT_NEAR(*m.volume, 8, 1e-9);
  EXPECT_NEAR(m.centroid[1], 5800000, 1e-6);
  EXPECT_NEAR(m.shortest_edge, 2, 1e-9);
  EXPECT_NEAR(m.longest_edge, std::sqrt(8), 1e-9);
  EXPECT_NEAR(m.mean_edge, (12 * 2 + 6 * std::sqrt(8)) / 18, 1e-9);
  EXPECT_NEAR(m.total_gaussian_curvature, 4 * kPi, 1e-9);
  EXPECT_NEAR(m.mean_absolute_mean_curvature, 0.5 * 12 * 2 * kPi / 2 / 24, 1e-9)
      << "twelve edges bent by a right angle";
}

TEST(MeasureMesh, ApproachesTheSphere) {
  const MeshMeasures m = measure_mesh(sphere(2, 100));
  EXPECT_NEAR(m.area, 16 * kPi, 0.05);
  EXPECT_NEAR(*m.volume, 32 * kPi / 3, 0.05);
  EXPECT_NEAR(m.total_gaussian_curvature, 4 * kPi, 1e-6);
  EXPECT_NEAR(m.mean_absolute_mean_curvature, 0.5, 0.01);
}

TEST(MeasureMesh, TellsPartsApart) {
  TriangleMesh mesh = sphere(1, 20);
  const TriangleMesh other = cube({10, 0, 0});
  for (const auto& t : other.triangles) {
    const auto n = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.triangles.push_back({t[0] + n, t[1] + n, t[2] + n});
  }
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  MeshMeasures m = measure_mesh(mesh);
  ASSERT_EQ(m.parts.size(), 2U);
  EXPECT_NEAR(m.parts[0].area, 24, 1e-9) << "the larger first";
  EXPECT_NEAR(*m.volume, m.parts[0].volume + m.parts[1].volume, 1e-12);
  EXPECT_EQ(m.parts[0].low[0], 9);

  mesh.triangles.pop_back();
  m = measure_mesh(mesh);
  EXPECT_FALSE(m.volume) << "the cube has a hole";
  EXPECT_EQ(m.boundary_edges, 3U);
  EXPECT_NEAR(m.boundary_length, 4 + std::sqrt(8), 1e-9);
  EXPECT_TRUE(m.parts[1].closed);
  EXPECT_NEAR(m.parts[1].volume, 4 * kPi / 3, 0.1);
}

TEST(MeasureMesh, InsideOutIsNegative) {
  TriangleMesh mesh = cube({});
  for (auto& t : mesh.triangles) std::swap(t[0], t[1]);
  EXPECT_NEAR(*measure_mesh(mesh).volume, -8, 1e-9);
}

}  // namespace
}  // namespace lamina
