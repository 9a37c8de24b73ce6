// Open things closed by invention: closed and manifold, the seen surface as it was, what was invented marked.
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "chunks/chunked.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;
using test::Reconstruction;

SurfaceSettings filling_all() {
  SurfaceSettings s;
  s.fill_all = true;
  return s;
}

double volume_of(const TriangleMesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const Point3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    sum += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  }
  return sum / 6;
}

/// OpenMesh takes every triangle and finds no boundary; no two vertices share a place.
void expect_closed(const TriangleMesh& mesh) {
  OpenMesh::TriMesh_ArrayKernelT<> other;
  std::vector<OpenMesh::VertexHandle> handles;
  for (const Point3& p : mesh.positions)
    handles.push_back(other.add_vertex({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])}));
  for (const auto& t : mesh.triangles)
    ASSERT_TRUE(other.add_face(handles[t[0]], handles[t[1]], handles[t[2]]).is_valid());
  for (const auto edge : other.edges()) ASSERT_FALSE(other.is_boundary(edge));
  EXPECT_EQ(std::set<Point3>(mesh.positions.begin(), mesh.positions.end()).size(), mesh.positions.size());
}

/// `closed` is `open` and something behind it, all of which is marked and nothing else.
void expect_added(const Reconstruction& open, const Reconstruction& closed) {
  ASSERT_GE(closed.mesh.positions.size(), open.mesh.positions.size());
  const std::size_t old = open.mesh.positions.size();
  EXPECT_TRUE(std::equal(open.mesh.positions.begin(), open.mesh.positions.end(), closed.mesh.positions.begin()));
  EXPECT_TRUE(std::equal(open.mesh.normals.begin(), open.mesh.normals.end(), closed.mesh.normals.begin()));
  EXPECT_TRUE(std::equal(open.mesh.triangles.begin(), open.mesh.triangles.end(), closed.mesh.triangles.begin()));
  ASSERT_EQ(closed.mesh.layout.back().name, "invented");
  const std::vector<float>& invented = closed.mesh.attributes.back();
  for (std::size_t v = 0; v < invented.size(); ++v) ASSERT_EQ(invented[v], v < old ? 0.0F : 1.0F);
  for (std::size_t t = open.mesh.triangles.size(); t < closed.mesh.triangles.size(); ++t) {
    const auto& triangle = closed.mesh.triangles[t];
    ASSERT_TRUE(std::any_of(triangle.begin(), triangle.end(), [&](std::uint32_t v) { return invented[v] == 1; }));
  }
  EXPECT_EQ(closed.stats.holes.invented, open.stats.holes.open);
  EXPECT_EQ(closed.stats.holes.invented_edges, open.stats.holes.open_edges);
  EXPECT_EQ(closed.stats.holes.invented_vertices, closed.mesh.positions.size() - old);
  EXPECT_EQ(closed.stats.holes.open, 0U);
}

Reconstruction expect_filled(const Cloud& cloud, SurfaceSettings settings = {}) {
  const Reconstruction open = test::reconstruct(cloud, settings);
  EXPECT_GT(open.stats.holes.open, 0U);
  settings.fill_all = true;
  Reconstruction closed = test::reconstruct(cloud, settings);
  EXPECT_TRUE(closed.facts.is_closed_manifold());
  expect_closed(closed.mesh);
  expect_added(open, closed);
  return closed;
}

Cloud box_without_lid(std::size_t count) {
  std::mt19937 random(6);
  std::uniform_real_distribution<> uniform(-1, 1);
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t side = i % 5;
    const std::size_t axis = side / 2;
    const double sign = side % 2 == 0 ? -1 : 1;
    Point3 p{uniform(random), uniform(random), uniform(random)}, n{};
    p[axis] = sign;
    n[axis] = sign;
    cloud.add(p, n);
  }
  return cloud;
}

double terrain_height(double x, double y) {
  return 0.15 * std::sin(3 * x) * std::cos(2 * y);
}

Cloud terrain(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<> uniform(-1, 1);
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = uniform(random), y = uniform(random);
    const Point3 n{-0.45 * std::cos(3 * x) * std::cos(2 * y), 0.3 * std::sin(3 * x) * std::sin(2 * y), 1};
    const double l = test::length(n);
    cloud.add({x, y, terrain_height(x, y)}, {n[0] / l, n[1] / l, n[2] / l});
  }
  return cloud;
}

TEST(FillAll, ClosesASphereWithoutThreeCaps) {
  const std::vector<Point3> caps{{0, 0, 1}, {0.8, 0, -0.6}, {-0.6, 0.8, 0}};
  const Cloud cloud = test::sphere_cloud(6000, [&](const Point3& p) {
    return std::any_of(caps.begin(), caps.end(),
                       [&](const Point3& c) { return p[0] * c[0] + p[1] * c[1] + p[2] * c[2] > std::cos(0.45); })
               ? 0.0
               : 1.0;
  });
  SurfaceSettings s;
  s.close_holes = 0;
  const Reconstruction closed = expect_filled(cloud, s);
  EXPECT_EQ(closed.stats.holes.invented, 3U);
  EXPECT_EQ(closed.facts.euler, std::vector<long>{2});
  EXPECT_NEAR(volume_of(closed.mesh), 4 * std::numbers::pi / 3, 0.05);
  EXPECT_LT(test::deviation(closed.mesh, test::distance_to_sphere).largest, 0.05);
}

TEST(FillAll, ClosesABoxWithoutLid) {
  const Reconstruction closed = expect_filled(box_without_lid(12000));
  EXPECT_EQ(closed.facts.euler, std::vector<long>{2});
  EXPECT_NEAR(volume_of(closed.mesh), 8, 0.4);
}

TEST(FillAll, ClosesHalfATorus) {
  const Cloud whole = test::torus_cloud(16000);
  Cloud half;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    if (whole.positions[i][2] > 0) half.add(whole.positions[i], whole.normals[i]);
  }
  const Reconstruction closed = expect_filled(half);
  EXPECT_EQ(closed.facts.euler, std::vector<long>{2});
  const double truth = std::numbers::pi * std::numbers::pi * test::kTorusMajor * test::kTorusMinor * test::kTorusMinor;
  EXPECT_NEAR(volume_of(closed.mesh), truth, 0.05 * truth);
}

TEST(FillAll, ClosesATerrainBelowIt) {
  const Reconstruction closed = expect_filled(terrain(10000));
  EXPECT_EQ(closed.facts.euler, std::vector<long>{2});
  EXPECT_GT(volume_of(closed.mesh), 0.5);
  const std::size_t old = closed.mesh.positions.size() - closed.stats.holes.vertices;
  for (std::size_t v = old; v < closed.mesh.positions.size(); ++v) {
    const Point3& p = closed.mesh.positions[v];
    if (std::max(std::abs(p[0]), std::abs(p[1])) < 0.9) {
      EXPECT_LT(p[2], terrain_height(p[0], p[1]));
    }
  }
}

TEST(FillAll, MarksOnlyWhatIsInvented) {
  SurfaceSettings s;
  s.vertex_filled = true;
  s.close_holes = 20;
  s.fill_all = true;
  const Cloud cloud = test::sphere_cloud(4000, [](const Point3& p) { return p[2] > 0.97 || p[2] < -0.5 ? 0.0 : 1.0; });
  const Reconstruction r = test::reconstruct(cloud, s);
  EXPECT_TRUE(r.facts.is_closed_manifold());
  ASSERT_EQ(r.stats.holes.closed, 1U) << "the small gap, which the sphere around supports";
  ASSERT_EQ(r.stats.holes.invented, 1U);
  const auto& filled = r.mesh.attributes[0];
  const auto& invented = r.mesh.attributes[1];
  for (std::size_t v = 0; v < filled.size(); ++v) {
    EXPECT_LE(filled[v] + invented[v], 1);
    if (filled[v] == 1) {
      EXPECT_GT(r.mesh.positions[v][2], 0.9);
    }
    if (invented[v] == 1) {
      EXPECT_LT(r.mesh.positions[v][2], -0.4);
    }
  }
}

TEST(FillAll, ClosesEverySpeck) {
  Cloud cloud = test::plane_cloud(3000);
  const Cloud few = test::sphere_cloud(60);
  for (std::size_t i = 0; i < few.size(); ++i) {
    const Point3& p = few.positions[i];
    cloud.add({p[0] * 0.2, p[1] * 0.2, p[2] * 0.2 + 1}, few.normals[i]);
  }
  SurfaceSettings s = filling_all();
  s.close_holes = 0;
  const Reconstruction r = test::reconstruct(cloud, s);
  EXPECT_TRUE(r.facts.is_closed_manifold());
  expect_closed(r.mesh);
}

TEST(FillAll, SameForThreadsAndWindows) {
  const test::TemporaryFolder folder;
  SurfaceSettings s = filling_all();
  s.input = test::write_cloud(terrain(6000), folder / "in.ply");
  s.output = folder / "out.ply";
  std::set<std::string> bytes;
  for (const auto& [threads, window] : {std::pair{1, 1}, std::pair{2, 3}, std::pair{4, 64}}) {
    s.window = window;
    RunContext run;
    run.threads = threads;
    reconstruct_surface(s, run);
    bytes.insert(test::read_file(s.output));
  }
  EXPECT_EQ(bytes.size(), 1U);
}

TEST(FillAll, SameForChunks) {
  const test::TemporaryFolder folder;
  SurfaceSettings s = filling_all();
  s.input = test::write_cloud(terrain(6000), folder / "in.ply");
  const std::string store = folder / "store";
  write_store(s, store, {});
  const std::string whole = test::whole_bytes(s, folder);
  EXPECT_EQ(test::merged_bytes(test::make_parts(s, store, 3, folder), folder), whole);
}

TEST(FillAll, IsRefusedWhereLoopsMeet) {
  SurfaceSettings s = filling_all();
  s.cluster = ClusterMode::free;
  EXPECT_THROW(test::reconstruct(test::sphere_cloud(500), s), Error);
}

}  // namespace
}  // namespace lamina
