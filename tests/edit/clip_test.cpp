#include "lamina/edit.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>

#include "lamina/measure.h"
#include "render/shapes.h"
#include "support/mesh_check.h"

namespace lamina {
namespace {

using test::check_mesh;
using test::MeshFacts;
using test::sphere;

double area_of(const TriangleMesh& mesh) {
  return mesh.triangles.empty() ? 0 : measure_mesh(mesh).area;
}

RC_GTEST_PROP(ClipMesh, PartsAreManifoldAndMakeUpTheWhole, ()) {
  const auto coordinate = [] { return *rc::gen::inRange(-12, 13) * 0.1; };
  ClipRegion region;
  for (int i = *rc::gen::inRange(0, 3); i > 0; --i) {
    HalfSpace h{{coordinate(), coordinate(), coordinate()}, {coordinate(), coordinate(), coordinate()}};
    if (std::hypot(h.normal[0], h.normal[1], h.normal[2]) > 0) region.half_spaces.push_back(h);
  }
  if (region.half_spaces.empty() || *rc::gen::arbitrary<bool>()) {
    Box box;
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = coordinate();
      box.high[k] = box.low[k] + std::abs(coordinate());
    }
    region.box = box;
  }
  TriangleMesh mesh = sphere(1, 10);
  mesh.layout = {{"height", ScalarType::float32}};
  mesh.attributes.resize(1);
  for (const auto& p : mesh.positions) mesh.attributes[0].push_back(static_cast<float>(2 * p[2]));
  const TriangleMesh inside = clip_mesh(mesh, region, Keep::inside);
  const TriangleMesh outside = clip_mesh(mesh, region, Keep::outside);
  RC_ASSERT(std::abs(area_of(inside) + area_of(outside) - area_of(mesh)) < 1e-9);
  RC_ASSERT(check_mesh(inside.triangles).complex_edges == 0);
  RC_ASSERT(check_mesh(outside.triangles).complex_edges == 0);
  for (std::size_t v = 0; v < inside.positions.size(); ++v) {
    const auto& p = inside.positions[v];
    RC_ASSERT(std::abs(static_cast<double>(inside.attributes[0][v]) - 2 * p[2]) < 1e-6);
    if (region.box)
      for (std::size_t k = 0; k < 3; ++k) {
        RC_ASSERT(p[k] > region.box->low[k] - 1e-12);
        RC_ASSERT(p[k] < region.box->high[k] + 1e-12);
      }
    for (const HalfSpace& h : region.half_spaces) {
      double height = 0;
      for (std::size_t k = 0; k < 3; ++k) height += h.normal[k] * (p[k] - h.point[k]);
      RC_ASSERT(height > -1e-12);
    }
  }
}

TEST(ClipMesh, CutsTheSphereIntoCaps) {
  const TriangleMesh mesh = sphere(1, 60);
  for (const double z : {-0.6, 0.0, 0.3}) {
    const TriangleMesh cap = clip_mesh(mesh, {std::nullopt, {{{0, 0, z}, {0, 0, 2}}}}, Keep::inside);
    EXPECT_NEAR(area_of(cap), 2 * std::numbers::pi * (1 - z), 0.02) << z;
    const MeshFacts facts = check_mesh(cap.triangles);
    EXPECT_TRUE(facts.is_manifold());
    EXPECT_FALSE(facts.boundary.empty());
  }
}

TEST(ClipMesh, LeavesAMeshThatLiesInsideAsItIs) {
  const TriangleMesh mesh = sphere(1, 8);
  const TriangleMesh same = clip_mesh(mesh, {Box{{-1, -1, -1}, {1, 1, 1}}, {}}, Keep::inside);
  EXPECT_EQ(same.positions, mesh.positions);
  EXPECT_EQ(same.triangles, mesh.triangles);
  EXPECT_TRUE(clip_mesh(mesh, {Box{{-1, -1, -1}, {1, 1, 1}}, {}}, Keep::outside).triangles.empty());
}

}  // namespace
}  // namespace lamina
