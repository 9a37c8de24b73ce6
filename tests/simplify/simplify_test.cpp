#include "lamina/simplify.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <cmath>
#include <cstdint>
#include <vector>

#include "lamina/error.h"
#include "lamina/measure.h"
#include "meshes/mesh_files.h"
#include "simplify/quadric.h"

namespace lamina {
namespace {

using namespace testing_meshes;

/// n x n squares over [0, 1]^2, at the heights of a function.
template <class Height>
TriangleMesh field(std::uint32_t n, const Height& height) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t j = 0; j <= n; ++j) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      mesh.positions.push_back({x, y, height(x, y)});
    }
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  return mesh;
}

bool manifold_to_openmesh(const TriangleMesh& mesh) {
  OpenMesh::TriMesh_ArrayKernelT<> other;
  std::vector<OpenMesh::VertexHandle> handles;
  for (const auto& p : mesh.positions)
    handles.push_back(other.add_vertex({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])}));
  for (const auto& t : mesh.triangles) {
    if (!other.add_face(handles[t[0]], handles[t[1]], handles[t[2]]).is_valid()) return false;
  }
  for (const auto v : other.vertices()) {
    if (!other.is_manifold(v)) return false;
  }
  return true;
}

TEST(Quadric, LeastIsWherePlanesMeet) {
  simplify::Quadric q;
  for (std::size_t k = 0; k < 3; ++k) {
    meshes::Vec3 n{};
    n[k] = 1;
    q += simplify::plane_quadric({1, 2, 3}, n, 2, 1e-3);
  }
  const auto least = q.least();
  ASSERT_TRUE(least.has_value());
  EXPECT_NEAR((*least)[0], 1, 1e-12);
  EXPECT_NEAR((*least)[1], 2, 1e-12);
  EXPECT_NEAR((*least)[2], 3, 1e-12);
  EXPECT_NEAR(q.at({2, 2, 3}), 2, 1e-4);
}

TEST(Simplify, APlaneKeepsItsOutlineWithFewTriangles) {
  TriangleMesh mesh = field(40, [](double, double) { return 0.0; });
  const SimplifyStats stats = simplify_mesh(mesh, {40});
  EXPECT_TRUE(stats.reached);
  EXPECT_LE(stats.triangles_after, 40u);
  EXPECT_EQ(stats.triangles_after, mesh.triangles.size());
  const MeshMeasures m = measure_mesh(mesh);
  EXPECT_NEAR(m.area, 1, 1e-2);
  EXPECT_NEAR(m.boundary_length, 4, 4e-2);
}

TEST(Simplify, ASphereStaysNearItsSurface) {
  TriangleMesh mesh = sphere(1, 60, 120);
  const std::size_t wanted = mesh.triangles.size() / 10;
  ASSERT_TRUE(simplify_mesh(mesh, {wanted}).reached);
  EXPECT_TRUE(check_mesh(mesh).closed());
  // The sagitta of an equilateral triangle of the mean area: a^2 / 6 with a^2 = 4 A / sqrt(3), twice for uneven ones.
  const double area = 4 * 3.14159265 / static_cast<double>(wanted);
  for (const auto& p : mesh.positions) EXPECT_NEAR(meshes::norm(p), 1, 4 * area / std::sqrt(3.0) / 3);
}

TEST(Simplify, FloatsStayFloats) {
  TriangleMesh mesh = sphere(1, 60, 120);
  const auto as_float = [](double c) { return static_cast<double>(static_cast<float>(c)); };
  for (auto& p : mesh.positions) p = {as_float(p[0]), as_float(p[1]), as_float(p[2])};
  simplify_mesh(mesh, {mesh.triangles.size() / 4});
  for (const auto& p : mesh.positions) {
    for (const double c : p) ASSERT_EQ(c, as_float(c));
  }
}

TEST(Simplify, ACreaseKeepsItsPlace) {
  TriangleMesh mesh = field(40, [](double x, double) { return std::abs(x - 0.5); });
  const TriangleMesh before = mesh;
  simplify_mesh(mesh, {100});
  EXPECT_LT(compare(mesh, before, {20000}).b_to_a->max, 0.02);
}

TEST(Simplify, TopologyStays) {
  rc::check([] {
    const auto n = *rc::gen::inRange<std::uint32_t>(3, 16);
    const auto holes = *rc::gen::container<std::vector<std::uint32_t>>(rc::gen::inRange<std::uint32_t>(0, n * n));
    const double wave = *rc::gen::inRange(0, 20);
    TriangleMesh mesh = field(n, [&](double x, double y) { return 0.1 * std::sin(wave * x) * std::cos(wave * y); });
    std::vector<bool> gone(mesh.triangles.size());
    for (const auto h : holes) gone[2 * std::size_t{h}] = gone[2 * std::size_t{h} + 1] = true;
    TriangleMesh open = mesh;
    open.triangles.clear();
    for (std::size_t t = 0; t < gone.size(); ++t) {
      if (!gone[t]) open.triangles.push_back(mesh.triangles[t]);
    }
    RC_PRE(!open.triangles.empty());
    const CheckReport before = check_mesh(open);
    RC_PRE(before.manifold());
    const auto wanted = *rc::gen::inRange<std::size_t>(1, open.triangles.size() + 1);
    const SimplifyStats stats = simplify_mesh(open, {wanted});
    const CheckReport after = check_mesh(open);
    RC_ASSERT(after.manifold());
    RC_ASSERT(manifold_to_openmesh(open));
    RC_ASSERT(after.euler_characteristic == before.euler_characteristic);
    RC_ASSERT(after.boundary_loops == before.boundary_loops);
    RC_ASSERT(after.components == before.components);
    RC_ASSERT(after.zero_area_triangles == 0u);
    RC_ASSERT(stats.triangles_after == open.triangles.size());
    RC_ASSERT(stats.reached == (open.triangles.size() <= wanted));
  });
}

TEST(Simplify, PiecesLeaveNoTraceAndThreadsNone) {
  const TriangleMesh before = field(200, [](double x, double y) { return 0.1 * std::sin(9 * x) * std::cos(7 * y); });
  std::vector<TriangleMesh> after(3, before);
  for (const int threads : {1, 2, 5}) {
    RunContext run;
    run.threads = threads;
    EXPECT_TRUE(simplify_mesh(after[static_cast<std::size_t>(threads / 2)], {8000}, run).reached);
  }
  EXPECT_EQ(after[0].positions, after[1].positions);
  EXPECT_EQ(after[0].triangles, after[1].triangles);
  EXPECT_EQ(after[0].positions, after[2].positions);
  EXPECT_EQ(after[0].triangles, after[2].triangles);
  EXPECT_GE(after[0].triangles.size(), 7999u);
  const CheckReport r = check_mesh(after[0]);
  EXPECT_TRUE(r.manifold());
  EXPECT_TRUE(manifold_to_openmesh(after[0]));
  EXPECT_EQ(r.euler_characteristic, 1);
  EXPECT_EQ(r.boundary_loops, 1u);
  // No seams: nowhere are triangles as small as they were.
  const MeshMeasures m = measure_mesh(after[0]);
  EXPECT_GT(m.shortest_edge, 1.0 / 200 / 3);
  EXPECT_LT(compare(after[0], before, {20000}).b_to_a->max, 1e-3);
}

TEST(Simplify, EveryNumberIsReached) {
  const TriangleMesh before = field(160, [](double x, double y) { return 0.1 * std::sin(9 * x) * std::cos(7 * y); });
  for (const double share : {1.0, 0.999, 0.95, 0.88, 0.8, 0.7, 0.67, 0.5, 0.3}) {
    TriangleMesh mesh = before;
    const auto wanted = static_cast<std::size_t>(share * static_cast<double>(before.triangles.size()));
    EXPECT_TRUE(simplify_mesh(mesh, {wanted}).reached) << share;
    EXPECT_LE(mesh.triangles.size(), wanted);
    EXPECT_GE(mesh.triangles.size() + 1, wanted);
  }
}

TEST(Simplify, EndsWhereNothingCanGo) {
  // Slabs of tetrahedra: no edge of any can go, and there are many pieces.
  TriangleMesh mesh;
  const TriangleMesh one = tetrahedron();
  for (std::uint32_t i = 0; i < 9000; ++i) {
    for (auto p : one.positions) {
      p[0] += 3.0 * i;
      mesh.positions.push_back(p);
    }
    for (const auto& t : one.triangles) mesh.triangles.push_back({t[0] + 4 * i, t[1] + 4 * i, t[2] + 4 * i});
  }
  EXPECT_FALSE(simplify_mesh(mesh, {100}).reached);
  EXPECT_EQ(mesh.triangles.size(), 36000u);
}

TEST(Simplify, AttributesAreInterpolated) {
  TriangleMesh mesh = field(30, [](double, double) { return 0.0; });
  mesh.layout = {{"x_again", ScalarType::float32}};
  mesh.attributes.emplace_back();
  for (const auto& p : mesh.positions) mesh.attributes[0].push_back(static_cast<float>(p[0]));
  simplify_mesh(mesh, {300});
  ASSERT_EQ(mesh.attributes[0].size(), mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) EXPECT_NEAR(mesh.attributes[0][v], mesh.positions[v][0], 0.1);
}

TEST(Simplify, SmallestThingsStay) {
  TriangleMesh solid = tetrahedron();
  const SimplifyStats stats = simplify_mesh(solid, {1});
  EXPECT_FALSE(stats.reached);
  EXPECT_EQ(solid.triangles.size(), 4u);
}

TEST(Simplify, TellsWhatItCannotDo) {
  const auto code = [](TriangleMesh mesh, std::uint64_t triangles) {
    try {
      simplify_mesh(mesh, {triangles});
    } catch (const Error& error) {
      return error.code();
    }
    return ExitCode::ok;
  };
  EXPECT_EQ(code(tetrahedron(), 0), ExitCode::usage);
  EXPECT_EQ(code(tetrahedron(), 5), ExitCode::usage);
  EXPECT_EQ(code(tetrahedron(), 4), ExitCode::ok);
  TriangleMesh fin = tetrahedron();
  fin.positions.push_back({3, 3, 3});
  fin.triangles.push_back({0, 1, 4});
  EXPECT_EQ(code(fin, 2), ExitCode::unreadable);
}

}  // namespace
}  // namespace lamina
