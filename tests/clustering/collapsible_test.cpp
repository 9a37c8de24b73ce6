#include "clustering/resolve.h"

#include <gtest/gtest.h>

namespace lamina::clustering {
namespace {

/// Triangles by vertex; a vertex's label is label[vertex].
bool test(const std::vector<std::uint64_t>& label, const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  std::vector<StarTriangle> star;
  for (const auto& t : triangles) star.push_back({t, {label[t[0]], label[t[1]], label[t[2]]}});
  ComponentScratch scratch;
  return collapses(star, 100, scratch);
}

// Vertex 0 inside a ring of others, labels as given.
TEST(Collapsible, AFanNeedsThreeNeighbours) {
  EXPECT_TRUE(test({100, 1, 2, 3}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}}));
  EXPECT_TRUE(test({100, 1, 1, 2, 3}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}})) << "repeats merge";
  EXPECT_FALSE(test({100, 1, 1, 2, 2}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}})) << "two are left";
  EXPECT_FALSE(test({100, 1, 1, 1}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}})) << "one is left";
}

TEST(Collapsible, ANeighbourMetTwiceForbids) {
  EXPECT_FALSE(test({100, 1, 2, 1, 3}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}}));
}

TEST(Collapsible, OpenFansNeedTwoNeighbours) {
  EXPECT_TRUE(test({100, 1, 2}, {{0, 1, 2}}));
  EXPECT_TRUE(test({100, 1, 2, 3}, {{0, 1, 2}, {0, 2, 3}}));
  EXPECT_FALSE(test({100, 1, 1}, {{0, 1, 2}}));
  EXPECT_FALSE(test({100, 1, 2, 1}, {{0, 1, 2}, {0, 2, 3}})) << "both ends in one neighbour";
}

TEST(Collapsible, TheBoundaryPassesOnce) {
  // An edge 0-5 of the component between two boundaries: four boundary edges leave it.
  EXPECT_FALSE(test({100, 1, 2, 3, 4, 100}, {{0, 1, 5}, {0, 5, 2}}));
  // Both ends on one boundary that runs along the edge.
  EXPECT_TRUE(test({100, 1, 2, 3, 4, 100}, {{1, 5, 0}, {1, 2, 5}, {3, 1, 0}}));
}

TEST(Collapsible, ARingIsNotADisk) {
  // Three members around a hole of the complex, each other triangle outside.
  std::vector<std::array<std::uint32_t, 3>> outer{{0, 1, 3}, {1, 4, 3}, {1, 2, 4}, {2, 5, 4}, {2, 0, 5}, {0, 3, 5}};
  EXPECT_FALSE(test({100, 100, 100, 1, 2, 3}, outer));
  outer.push_back({0, 2, 1});
  EXPECT_TRUE(test({100, 100, 100, 1, 2, 3}, outer));
}

TEST(Collapsible, AVertexMetTwiceForbids) {
  // Vertex 1 reaches into the component: around member edge 0-5, neighbour 2 has a leaf 6 that only the component
  // holds.
  const std::vector<std::uint64_t> label{100, 1, 2, 3, 4, 100, 2};
  EXPECT_FALSE(test(label, {{0, 1, 2}, {0, 2, 6}, {0, 6, 5}, {5, 6, 2}, {5, 2, 3}, {5, 3, 0}, {0, 3, 1}}));
}

}  // namespace
}  // namespace lamina::clustering
