#include "boundary/gap_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <random>
#include <set>
#include <vector>

namespace lamina::boundary {
namespace {

using Vec2 = Eigen::Vector2d;

double cross_of(const Vec2& a, const Vec2& b) {
  return a.x() * b.y() - a.y() * b.x();
}

double area_of(const std::vector<Vec2>& polygon) {
  double sum = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) sum += cross_of(polygon[i], polygon[(i + 1) % polygon.size()]);
  return 0.5 * sum;
}

/// Straight sides of many short edges, bays that wind in between, and a little chance: what rims of scans are like.
std::vector<Vec2> ragged_outline(std::mt19937& chance) {
  std::uniform_real_distribution<> unit(0, 1);
  std::vector<Vec2> corners;
  const int rays = 40;
  for (int i = 0; i < rays; ++i) {
    const double angle = 2 * std::numbers::pi * (i + 0.8 * unit(chance)) / rays;
    const double radius = 1 + (i % 2 == 0 ? 4 : 0.5) * unit(chance);
    corners.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  std::vector<Vec2> outline;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec2 &from = corners[i], &to = corners[(i + 1) % corners.size()];
    const int steps = 1 + static_cast<int>(20 * unit(chance));
    for (int k = 0; k < steps; ++k) outline.push_back(from + (to - from) * (static_cast<double>(k) / steps));
  }
  return outline;
}

// Along straight sides there are no ears: those elsewhere must go so that none of the sides' corners is left over.
TEST(TriangulateByEars, CoversAnyOutlineOnce) {
  std::mt19937 chance(11);
  for (int round = 0; round < 60; ++round) {
    const std::vector<Vec2> outline = ragged_outline(chance);
    std::vector<std::uint32_t> polygon(outline.size());
    std::iota(polygon.begin(), polygon.end(), 0U);
    const auto triangles = triangulate_by_ears(outline, polygon, [](auto, auto) { return true; });
    ASSERT_TRUE(triangles) << round;
    ASSERT_EQ(triangles->size(), outline.size() - 2);
    double sum = 0;
    std::set<std::pair<std::uint32_t, std::uint32_t>> ways;
    for (const PlaneTriangle& t : *triangles) {
      const double area = area_of({outline[t[0]], outline[t[1]], outline[t[2]]});
      EXPECT_GT(area, -1e-12);
      sum += area;
      for (std::size_t k = 0; k < 3; ++k) EXPECT_TRUE(ways.emplace(t[k], t[(k + 1) % 3]).second);
    }
    EXPECT_NEAR(sum, area_of(outline), 1e-9 * sum);
    for (std::uint32_t i = 0; i < outline.size(); ++i)
      EXPECT_TRUE(ways.contains({i, static_cast<std::uint32_t>((i + 1) % outline.size())}));
  }
}

TEST(TriangulateByEars, KeepsOffChordsThatAreNotAllowed) {
  const std::vector<Vec2> square{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  const auto without = [&](std::uint32_t a, std::uint32_t b) {
    return triangulate_by_ears(square, {0, 1, 2, 3}, [=](std::uint32_t i, std::uint32_t j) {
      return std::pair(std::min(i, j), std::max(i, j)) != std::pair(a, b);
    });
  };
  const auto triangles = without(0, 2);
  ASSERT_TRUE(triangles);
  for (const PlaneTriangle& t : *triangles)
    EXPECT_EQ(
        std::set<std::uint32_t>(t.begin(), t.end()).count(1) + std::set<std::uint32_t>(t.begin(), t.end()).count(3),
        2U);
}

// Where the mesh has an edge already a filling may not have one: a vertex on it makes two of it.
TEST(TriangulateByEars, ChordsThatAreNotAllowedAreSplitInTheEnd) {
  std::vector<Vec2> points{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  const auto rim_only = [](std::uint32_t i, std::uint32_t j) { return std::max(i, j) >= 4 || (i + j) % 2 == 1; };
  auto triangles = triangulate_by_ears(points, {0, 1, 2, 3}, rim_only);
  ASSERT_TRUE(triangles);
  std::vector<double> scale(4, 10);
  refine_triangles(points, scale, *triangles, rim_only);
  EXPECT_EQ(points.size(), 5U);
  EXPECT_EQ(scale.size(), 5U);
  double sum = 0;
  for (const PlaneTriangle& t : *triangles) {
    sum += area_of({points[t[0]], points[t[1]], points[t[2]]});
    for (std::size_t k = 0; k < 3; ++k) EXPECT_TRUE(rim_only(t[k], t[(k + 1) % 3]));
  }
  EXPECT_DOUBLE_EQ(sum, 1);
}

}  // namespace
}  // namespace lamina::boundary
