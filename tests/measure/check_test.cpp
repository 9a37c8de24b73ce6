#include "lamina/measure.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <limits>
#include <set>

#include "meshes/mesh_files.h"

namespace lamina {
namespace {

using namespace testing_meshes;

void append(TriangleMesh& to, const TriangleMesh& m, double shift) {
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  for (auto p : m.positions) {
    p[0] += shift;
    to.positions.push_back(p);
  }
  for (const auto& t : m.triangles) to.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

/// n x m quads wrapped both ways.
TriangleMesh torus(std::uint32_t n, std::uint32_t m) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < m; ++j) {
      const double u = 6.283185307179586 * i / n, v = 6.283185307179586 * j / m;
      mesh.positions.push_back({(2 + std::cos(v)) * std::cos(u), (2 + std::cos(v)) * std::sin(u), std::sin(v)});
      const std::uint32_t a = i * m + j, b = (i + 1) % n * m + j, c = (i + 1) % n * m + (j + 1) % m,
                          d = i * m + (j + 1) % m;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  return mesh;
}

TEST(Check, ClosedShapesHaveTheirEulerCharacteristic) {
  const CheckReport t = check_mesh(tetrahedron());
  EXPECT_TRUE(t.closed());
  EXPECT_EQ(t.edges, 6u);
  EXPECT_EQ(t.euler_characteristic, 2);
  EXPECT_EQ(t.genus, 0);
  const CheckReport s = check_mesh(sphere(1, 20, 30));
  EXPECT_TRUE(s.closed());
  EXPECT_EQ(s.euler_characteristic, 2);
  EXPECT_EQ(s.zero_area_triangles, 0u);
  const CheckReport d = check_mesh(torus(20, 10));
  EXPECT_TRUE(d.closed());
  EXPECT_EQ(d.euler_characteristic, 0);
  EXPECT_EQ(d.genus, 1);
}

TEST(Check, ComponentsAreToldApart) {
  TriangleMesh m = torus(12, 8);
  append(m, sphere(1, 6, 6), 10);
  append(m, grid(3), 20);
  const CheckReport r = check_mesh(m);
  EXPECT_EQ(r.components, 3u);
  EXPECT_EQ(r.largest_component_triangles, 192u);
  EXPECT_EQ(r.largest_component_boundary_edges, 0u);
  EXPECT_EQ(r.euler_characteristic, 0 + 2 + 1);
  EXPECT_EQ(r.boundary_edges, 12u);
  EXPECT_TRUE(r.manifold());
  EXPECT_FALSE(r.closed());
  EXPECT_FALSE(r.genus.has_value());
}

TEST(Check, BoundaryLoopsAreCountedAndMeasured) {
  TriangleMesh m = grid(8);
  std::erase_if(m.triangles, [](const auto& t) { return t[0] == 3 * 9 + 3; });  // one quad out of the middle
  const CheckReport r = check_mesh(m);
  EXPECT_EQ(r.boundary_edges, 32u + 4u);
  EXPECT_EQ(r.boundary_loops, 2u);
  EXPECT_EQ(r.longest_loop_edges, 32u);
  EXPECT_NEAR(r.longest_loop_length, 4, 1e-12);
  EXPECT_EQ(r.euler_characteristic, 0);
  EXPECT_TRUE(r.manifold());
}

TEST(Check, TwoLoopsThatTouchInAVertexAreTwo) {
  TriangleMesh m = grid(8);
  std::erase_if(m.triangles, [](const auto& t) { return t[0] == 3 * 9 + 3 || t[0] == 4 * 9 + 4; });
  const CheckReport r = check_mesh(m);
  EXPECT_EQ(r.non_manifold_vertices, 1u) << "two fans meet between the holes";
  EXPECT_EQ(r.boundary_loops, 2u) << "the holes' rims run through both fans: one curve; and the outer rim";
  EXPECT_EQ(r.boundary_edges, 40u);
  EXPECT_FALSE(r.manifold());
}

TEST(Check, NonManifoldEdge) {
  TriangleMesh m;
  m.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}};
  m.triangles = {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}};
  const CheckReport r = check_mesh(m);
  EXPECT_EQ(r.non_manifold_edges, 1u);
  EXPECT_EQ(r.non_manifold_vertices, 0u) << "the fans hang together through the edge";
  EXPECT_EQ(r.inconsistent_edges, 0u) << "told of edges of two triangles only";
  EXPECT_FALSE(r.manifold());
}

TEST(Check, NonManifoldVertexBetweenTwoCones) {
  TriangleMesh m = tetrahedron();
  append(m, tetrahedron(), 5);
  for (auto& t : m.triangles)
    for (auto& v : t)
      if (v == 4) v = 0;
  const CheckReport r = check_mesh(m);
  EXPECT_EQ(r.non_manifold_vertices, 1u);
  EXPECT_EQ(r.non_manifold_edges, 0u);
  EXPECT_EQ(r.unreferenced_vertices, 1u);
  EXPECT_EQ(r.components, 1u);
  EXPECT_EQ(r.euler_characteristic, 3);
  EXPECT_FALSE(r.manifold());
}

TEST(Check, FlippedTriangleIsInconsistentAlongItsThreeSides) {
  TriangleMesh m = sphere(1, 8, 8);
  std::swap(m.triangles[20][0], m.triangles[20][1]);
  const CheckReport r = check_mesh(m);
  EXPECT_EQ(r.inconsistent_edges, 3u);
  EXPECT_EQ(r.boundary_edges, 0u);
  EXPECT_FALSE(r.manifold());
}

TEST(Check, MoebiusStripCannotBeOriented) {
  TriangleMesh m;
  constexpr std::uint32_t n = 7;
  for (std::uint32_t i = 0; i < n; ++i)
    for (const double w : {-1.0, 1.0}) m.positions.push_back({double(i), w, double(i * i)});
  for (std::uint32_t i = 0; i < n; ++i) {
    const bool twist = i + 1 == n;
    const std::uint32_t a = 2 * i, b = 2 * i + 1, c = 2 * ((i + 1) % n) + (twist ? 1 : 0),
                        d = 2 * ((i + 1) % n) + (twist ? 0 : 1);
    m.triangles.push_back({a, b, d});
    m.triangles.push_back({a, d, c});
  }
  const CheckReport r = check_mesh(m);
  EXPECT_EQ(r.inconsistent_edges, 1u);
  EXPECT_EQ(r.euler_characteristic, 0);
  EXPECT_EQ(r.boundary_loops, 1u);
  EXPECT_EQ(r.longest_loop_edges, 2 * n);
}

TEST(Check, DuplicatesDegeneratesAndStrays) {
  TriangleMesh m = tetrahedron();
  m.positions.push_back({0, 0, -0.0});                                      // 4: at 0
  m.positions.push_back({2, 0, 0});                                         // 5: in line with 0 and 1
  m.positions.push_back({std::numeric_limits<double>::quiet_NaN(), 0, 0});  // 6
  m.positions.push_back({std::numeric_limits<double>::quiet_NaN(), 0, 0});  // 7: NaN equals nothing
  m.triangles.push_back({2, 1, 0});                                         // the first, turned
  m.triangles.push_back({1, 1, 2});
  m.triangles.push_back({0, 1, 5});
  const CheckReport r = check_mesh(m);
  EXPECT_EQ(r.duplicate_vertices, 1u);
  EXPECT_EQ(r.non_finite_vertices, 2u);
  EXPECT_EQ(r.unreferenced_vertices, 3u);
  EXPECT_EQ(r.duplicate_triangles, 1u);
  EXPECT_EQ(r.repeated_index_triangles, 1u);
  EXPECT_EQ(r.zero_area_triangles, 1u);
  EXPECT_FALSE(r.manifold());
}

TEST(Check, OnlyIndexDegenerateTriangles) {
  TriangleMesh m;
  m.positions = {{0, 0, 0}, {1, 0, 0}};
  m.triangles = {{0, 0, 1}, {1, 1, 1}};
  const CheckReport r = check_mesh(m);
  EXPECT_EQ(r.repeated_index_triangles, 2u);
  EXPECT_EQ(r.edges, 0u);
  EXPECT_EQ(r.components, 0u);
  EXPECT_EQ(r.euler_characteristic, 0);
  EXPECT_FALSE(r.manifold());
}

TEST(Check, NoTrianglesIsAnError) {
  expect_error(ExitCode::unreadable, [] { check_mesh(TriangleMesh{}); }, {"no triangles"});
}

/// What OpenMesh's halfedge mesh says, where it can hold the mesh.
TEST(Check, AgreesWithOpenMeshOnRandomMeshes) {
  EXPECT_TRUE(rc::check("random parts of a torus", [] {
    const auto n = *rc::gen::inRange<std::uint32_t>(3, 9);
    const auto m = *rc::gen::inRange<std::uint32_t>(3, 9);
    TriangleMesh mesh = torus(n, m);
    const auto keep =
        *rc::gen::container<std::vector<bool>>(mesh.triangles.size(), rc::gen::element(true, true, true, false));
    std::vector<std::array<std::uint32_t, 3>> kept;
    for (std::size_t i = 0; i < keep.size(); ++i)
      if (keep[i]) kept.push_back(mesh.triangles[i]);
    RC_PRE(!kept.empty());
    mesh.triangles = kept;
    const CheckReport r = check_mesh(mesh);

    using Oracle = OpenMesh::TriMesh_ArrayKernelT<>;
    Oracle oracle;
    std::vector<Oracle::VertexHandle> handles;
    for (const auto& p : mesh.positions)
      handles.push_back(oracle.add_vertex(OpenMesh::Vec3f(float(p[0]), float(p[1]), float(p[2]))));
    std::size_t refused = 0;
    for (const auto& t : mesh.triangles)
      refused += !oracle.add_face(handles[t[0]], handles[t[1]], handles[t[2]]).is_valid();
    if (refused > 0) {
      // OpenMesh refuses what would not be manifold while it is added: ours must see a bow-tie.
      RC_ASSERT(r.non_manifold_vertices > 0);
      return;
    }
    std::size_t boundary = 0, isolated = 0, loops = 0, bow_ties = 0;
    for (const auto e : oracle.edges()) boundary += e.is_boundary();
    for (const auto v : oracle.vertices()) {
      isolated += oracle.is_isolated(v);
      std::size_t corners = 0, around = 0;
      for (const auto& t : mesh.triangles)
        for (const auto i : t) corners += static_cast<int>(i) == v.idx();
      for ([[maybe_unused]] const auto f : v.faces()) ++around;
      bow_ties += around != corners || !oracle.is_manifold(v);
    }
    std::set<int> walked;
    for (const auto h : oracle.halfedges())
      if (h.is_boundary() && !walked.contains(h.idx())) {
        ++loops;
        for (auto g = h; walked.insert(g.idx()).second;) g = g.next();
      }
    RC_ASSERT(r.edges == oracle.n_edges());
    RC_ASSERT(r.boundary_edges == boundary);
    RC_ASSERT(r.unreferenced_vertices == isolated);
    RC_ASSERT(r.non_manifold_vertices == bow_ties);
    RC_ASSERT(r.inconsistent_edges == 0u);
    RC_ASSERT(r.non_manifold_edges == 0u);
    RC_ASSERT(r.euler_characteristic == static_cast<std::int64_t>(oracle.n_vertices() - isolated) -
                                            static_cast<std::int64_t>(oracle.n_edges()) +
                                            static_cast<std::int64_t>(oracle.n_faces()));
    if (r.manifold()) RC_ASSERT(r.boundary_loops == loops);
  }));
}

TEST(Check, DoesNotDependOnTheOrderOfTriangles) {
  EXPECT_TRUE(rc::check("random soups", [] {
    TriangleMesh m;
    m.positions.resize(8);
    for (std::size_t i = 0; i < 8; ++i) m.positions[i] = {double(i), double(i * i % 5), double(i * 3 % 7)};
    m.triangles = *rc::gen::nonEmpty(rc::gen::container<std::vector<std::array<std::uint32_t, 3>>>(
        rc::gen::map(rc::gen::tuple(rc::gen::inRange(0u, 8u), rc::gen::inRange(0u, 8u), rc::gen::inRange(0u, 8u)),
                     [](const auto& t) {
                       return std::array<std::uint32_t, 3>{std::get<0>(t), std::get<1>(t), std::get<2>(t)};
                     })));
    const CheckReport a = check_mesh(m);
    std::reverse(m.triangles.begin(), m.triangles.end());
    for (auto& t : m.triangles) std::rotate(t.begin(), t.begin() + 1, t.end());
    const CheckReport b = check_mesh(m);
    RC_ASSERT(a.edges == b.edges);
    RC_ASSERT(a.non_manifold_edges == b.non_manifold_edges);
    RC_ASSERT(a.non_manifold_vertices == b.non_manifold_vertices);
    RC_ASSERT(a.inconsistent_edges == b.inconsistent_edges);
    RC_ASSERT(a.duplicate_triangles == b.duplicate_triangles);
    RC_ASSERT(a.boundary_loops == b.boundary_loops);
    RC_ASSERT(a.components == b.components);
    RC_ASSERT(a.euler_characteristic == b.euler_characteristic);
  }));
}

}  // namespace
}  // namespace lamina
