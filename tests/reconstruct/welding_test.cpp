// A mesh welded by position, as readers of STL and many programs weld, is the mesh: as many vertices, as manifold.
#include <gtest/gtest.h>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "base/temporary_folder.h"
#include "chunks/chunked.h"
#include "lamina/mesh.h"
#include "reconstruct/clouds.h"
#include "support/mesh_check.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;
using test::Triangles;

/// A disc seen from both sides, thinner than its noise.
Cloud thin_plate(std::size_t count, double thickness, double noise) {
  std::mt19937 random(5);
  std::uniform_real_distribution<> uniform(-1, 1);
  std::normal_distribution<> normal;
  Cloud cloud;
  while (cloud.size() < count) {
    const double x = uniform(random), y = uniform(random), side = uniform(random) < 0 ? -1 : 1;
    if (std::hypot(x, y) > 1) continue;
    Point3 n{0.3 * normal(random), 0.3 * normal(random), side};
    for (double& c : n) c /= test::length(n);
    cloud.add({x, y, 0.5 * side * thickness + noise * normal(random)}, n);
  }
  return cloud;
}

/// Samples that lie in one another, with normals of their own, on a sphere with holes.
Cloud doubled_samples(std::size_t count) {
  Cloud cloud = test::sphere_cloud(
      count, [](const Point3& p) { return std::sin(9 * p[0]) * std::sin(7 * p[1]) > -0.5 ? 1.0 : 0.03; });
  std::mt19937 random(8);
  for (std::size_t i = 0; i < count; i += 2) cloud.add(cloud.positions[i], test::random_direction(random));
  return cloud;
}

/// Around a curve, on a rough tube.
Cloud rough_tube(std::size_t count, double noise) {
  std::mt19937 random(11);
  std::uniform_real_distribution<> uniform;
  std::normal_distribution<> normal;
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = 6 * uniform(random), a = 6.2831853 * uniform(random), r = 0.3 + noise * normal(random);
    cloud.add({std::cos(z) + r * std::cos(a), r * std::sin(a), z}, {std::cos(a), std::sin(a), 0});
  }
  return cloud;
}

/// Vertices by the floats of their positions; the number of places.
std::size_t weld(const TriangleMesh& mesh, Triangles& triangles) {
  std::map<std::array<float, 3>, std::uint32_t> places;
  std::vector<std::uint32_t> place;
  for (const auto& p : mesh.positions) {
    const std::array<float, 3> at{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    place.push_back(places.try_emplace(at, static_cast<std::uint32_t>(places.size())).first->second);
  }
  triangles = mesh.triangles;
  for (auto& t : triangles) {
    for (std::uint32_t& v : t) v = place[v];
  }
  return places.size();
}

/// OpenMesh takes every triangle, and finds no vertex of two fans.
void expect_openmesh_agrees(const Triangles& triangles, std::size_t vertices) {
  using Mesh = OpenMesh::TriMesh_ArrayKernelT<>;
  Mesh mesh;
  std::vector<Mesh::VertexHandle> handles;
  for (std::size_t v = 0; v < vertices; ++v) handles.push_back(mesh.add_vertex({0, 0, 0}));
  std::size_t refused = 0, several = 0;
  for (const auto& t : triangles) refused += !mesh.add_face(handles[t[0]], handles[t[1]], handles[t[2]]).is_valid();
  for (const auto v : mesh.vertices()) several += !mesh.is_manifold(v);
  EXPECT_EQ(refused, 0U);
  EXPECT_EQ(several, 0U);
}

void expect_weldable(const Cloud& cloud, SurfaceSettings settings, const Point3& offset = {0, 0, 0}) {
  const test::TemporaryFolder folder;
  Cloud moved = cloud;
  for (Point3& p : moved.positions) {
    for (std::size_t k = 0; k < 3; ++k) p[k] += offset[k];
  }
  settings.input = test::write_cloud(moved, folder / "in.ply", PlyFormat::little_endian, ScalarType::float64);
  settings.output = folder / "out.ply";
  reconstruct_surface(settings, {});
  const TriangleMesh mesh = read_mesh(settings.output);
  Triangles welded;
  EXPECT_EQ(weld(mesh, welded), mesh.positions.size());
  EXPECT_TRUE(test::check_mesh(welded).is_manifold());
  expect_openmesh_agrees(welded, mesh.positions.size());
  // STL has nothing but positions: its reader welds.
  settings.output = folder / "out.stl";
  reconstruct_surface(settings, {});
  EXPECT_EQ(read_mesh(settings.output).positions.size(), mesh.positions.size());
  write_store(settings, folder / "store", {});
  EXPECT_TRUE(test::merged_bytes(test::make_parts(settings, folder / "store", 4, folder), folder) ==
              test::read_file(folder / "out.ply"));
}

std::vector<SurfaceSettings> wide_and_narrow() {
  std::vector<SurfaceSettings> list;
  for (const double blend : {0.6, 1.2, 2.0}) list.emplace_back().blend = blend;
  list.emplace_back().cluster = ClusterMode::none;
  return list;
}

TEST(Welding, ThinPlates) {
  for (const SurfaceSettings& s : wide_and_narrow()) expect_weldable(thin_plate(6000, 0.02, 0.01), s);
}

TEST(Welding, SamplesAtOnePlace) {
  for (const SurfaceSettings& s : wide_and_narrow()) expect_weldable(doubled_samples(6000), s);
}

TEST(Welding, NoiseAndHoles) {
  for (const SurfaceSettings& s : wide_and_narrow()) expect_weldable(rough_tube(6000, 0.05), s);
}

TEST(Welding, CoordinatesThatFloatsHoldBarely) {
  for (const SurfaceSettings& s : wide_and_narrow()) expect_weldable(rough_tube(6000, 0.02), s, {2000, -1500, 1200});
}

}  // namespace
}  // namespace lamina
