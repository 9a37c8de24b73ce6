#include "measure/edge_table.h"

#include <gtest/gtest.h>

#include "render/shapes.h"

namespace lamina::measure {
namespace {

TEST(BoundaryEdges, AreThoseOfOneTriangle) {
  EXPECT_TRUE(boundary_edges(test::sphere(1, 9)).empty());
  const std::vector<Edge> sides{{0, 1}, {0, 3}, {1, 2}, {2, 3}};
  EXPECT_EQ(boundary_edges(test::square(1, 0, {0, 0, 0})), sides);
  EXPECT_TRUE(boundary_edges({}).empty());
}

TEST(BoundaryEdges, AnEdgeOfThreeTrianglesIsNone) {
  TriangleMesh mesh;
  mesh.positions.resize(5);
  mesh.triangles = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}};
  for (const Edge& edge : boundary_edges(mesh)) EXPECT_NE(edge, (Edge{0, 1}));
  EXPECT_EQ(boundary_edges(mesh).size(), 6u);
}

TEST(BoundaryEdges, TrianglesThatRepeatAVertexHaveNone) {
  TriangleMesh mesh;
  mesh.positions.resize(3);
  mesh.triangles = {{0, 1, 2}, {1, 1, 2}};
  EXPECT_EQ(boundary_edges(mesh).size(), 3u);
}

}  // namespace
}  // namespace lamina::measure
