// Fillings of boundary loops on surfaces whose truth is known.
#include "boundary/fill.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

#include "support/mesh_check.h"

namespace lamina::boundary {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

/// A boundary loop of n vertices around the pole of the unit sphere, `angle` away from it: filled anticlockwise from
/// outside.
Loop sphere_loop(std::uint32_t n, double angle, double radius, double jitter = 0, std::uint32_t seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<> uniform(-jitter, jitter);
  Loop loop;
  for (std::uint32_t i = 0; i < n; ++i) {
    const double a = kTurn * (i + 0.4 * uniform(random)) / n, b = angle * (1 + uniform(random));
    const std::array<double, 3> p{std::sin(b) * std::cos(a), std::sin(b) * std::sin(a), std::cos(b)};
    BoundaryVertex v;
    v.number = 10 * i;
    v.position = p;
    v.normal = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    v.radius = static_cast<float>(radius);
    loop.vertices.push_back(v);
    loop.facing.push_back(p);
    loop.attributes.push_back(static_cast<float>(p[2]));
  }
  return loop;
}

void reverse(Loop& loop) {
  std::reverse(loop.vertices.begin(), loop.vertices.end());
  std::reverse(loop.facing.begin(), loop.facing.end());
}

/// A disc whose boundary loop is the loop.
void expect_disc(const Loop& loop, const Filling& filling) {
  ASSERT_EQ(filling.verdict, Verdict::filled) << describe(filling.verdict);
  const auto n = static_cast<std::uint32_t>(loop.vertices.size());
  const test::MeshFacts facts = test::check_mesh(filling.triangles);
  EXPECT_TRUE(facts.is_manifold());
  EXPECT_EQ(facts.euler, std::vector<long>{1});
  EXPECT_EQ(facts.boundary.size(), n);
  for (const auto& [from, to] : facts.boundary) EXPECT_EQ(to, (from + 1) % n);
}

TEST(Fill, OfASphereLiesOnTheSphere) {
  const Loop loop = sphere_loop(16, 0.3, 0.2);
  const Filling filling = fill_loop(loop, 12);
  expect_disc(loop, filling);
  ASSERT_GT(filling.positions.size(), 4U);
  for (std::size_t i = 0; i < filling.positions.size(); ++i) {
    const auto& p = filling.positions[i];
    EXPECT_NEAR(std::hypot(p[0], p[1], p[2]), 1, 1e-3);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(static_cast<double>(filling.normals[i][k]), p[k], 1e-2);
    EXPECT_NEAR(static_cast<double>(filling.attributes[i]), std::cos(0.3), 1e-5);
  }
}

RC_GTEST_PROP(Fill, RaggedRimsBecomeDiscsNearTheSphere, ()) {
  const auto n = *rc::gen::inRange<std::uint32_t>(3, 40);
  const Loop loop = sphere_loop(n, 0.25, 0.2, 0.15, *rc::gen::arbitrary<std::uint32_t>());
  const Filling filling = fill_loop(loop, 100);
  RC_ASSERT(filling.verdict == Verdict::filled);
  expect_disc(loop, filling);
  for (const auto& p : filling.positions) RC_ASSERT(std::abs(std::hypot(p[0], p[1], p[2]) - 1) < 2e-3);
}

TEST(Fill, NotBeyondTheBound) {
  const Loop loop = sphere_loop(16, 0.3, 0.2);  // the boundary loop is 9.2 radii long
  EXPECT_EQ(fill_loop(loop, 9).verdict, Verdict::too_long);
  EXPECT_EQ(fill_loop(loop, 9.5).verdict, Verdict::filled);
}

TEST(Fill, NotOutsideOfASurface) {
  Loop loop = sphere_loop(12, 0.3, 0.2);
  reverse(loop);
  EXPECT_EQ(fill_loop(loop, 100).verdict, Verdict::outer_boundary);
}

TEST(Fill, NotTheEndOfATube) {
  Loop loop = sphere_loop(12, 0.3, 0.2);
  for (std::size_t i = 0; i < 12; ++i) {
    const double a = kTurn * static_cast<double>(i) / 12;
    loop.vertices[i].normal = {static_cast<float>(std::cos(a)), static_cast<float>(std::sin(a)), 0};
  }
  EXPECT_NE(fill_loop(loop, 100).verdict, Verdict::filled);
}

TEST(Fill, NotTheBackOfALoneTriangle) {
  Loop loop = sphere_loop(3, 0.2, 0.3);
  ASSERT_EQ(fill_loop(loop, 100).verdict, Verdict::filled);
  loop.facing.assign(3, {0, 0, -1});
  EXPECT_EQ(fill_loop(loop, 100).verdict, Verdict::outer_boundary);
}

TEST(Fill, UsesNoEdgeOfTheMesh) {
  Loop loop = sphere_loop(4, 0.2, 0.3);
  loop.taken = {{0, 2}};
  const Filling filling = fill_loop(loop, 100);
  expect_disc(loop, filling);
  for (const auto& t : filling.triangles)
    EXPECT_EQ(std::count(t.begin(), t.end(), 0U) + std::count(t.begin(), t.end(), 2U), 1);
  loop.taken = {{0, 2}, {1, 3}};
  EXPECT_EQ(fill_loop(loop, 100).verdict, Verdict::bent);
}

double area_of(const Loop& loop, const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  const auto at = [&](std::uint32_t v) { return Eigen::Vector3d(loop.vertices[v].position.data()); };
  double sum = 0;
  for (const auto& t : triangles) sum += (at(t[1]) - at(t[0])).cross(at(t[2]) - at(t[0])).norm() / 2;
  return sum;
}

/// Oracle: the least area of all triangulations of the vertices from i to k.
double least_area(const Loop& loop, std::uint32_t i, std::uint32_t k) {
  if (k < i + 2) return 0;
  double least = 1e300;
  for (std::uint32_t j = i + 1; j < k; ++j)
    least = std::min(least, least_area(loop, i, j) + least_area(loop, j, k) + area_of(loop, {{i, j, k}}));
  return least;
}

/// A boundary loop that no plane shows without crossings.
Loop winding_rim(std::uint32_t n, std::uint32_t seed) {
  Loop loop = sphere_loop(n, 0.5, 0.2);
  std::mt19937 random(seed);
  std::normal_distribution<> normal;
  for (BoundaryVertex& v : loop.vertices) v.position = {normal(random), normal(random), normal(random)};
  return loop;
}

RC_GTEST_PROP(FillAny, IsADiscOfLeastArea, ()) {
  const auto n = *rc::gen::inRange<std::uint32_t>(3, 9);
  const Loop loop = winding_rim(n, *rc::gen::arbitrary<std::uint32_t>());
  RC_PRE(!(n == 3 && fill_any(loop).verdict == Verdict::outer_boundary));
  const Filling filling = fill_any(loop);
  expect_disc(loop, filling);
  RC_ASSERT(filling.positions.empty());
  RC_ASSERT(std::abs(area_of(loop, filling.triangles) - least_area(loop, 0, n - 1)) < 1e-9);
}

TEST(FillAny, ClosesWhatNothingSupports) {
  Loop outer = sphere_loop(12, 0.3, 0.2);
  reverse(outer);
  expect_disc(outer, fill_any(outer));
  const Loop winding = winding_rim(30, 3);
  EXPECT_NE(fill_loop(winding, 1000).verdict, Verdict::filled);
  expect_disc(winding, fill_any(winding));
}

TEST(FillAny, GoesAroundANewVertexWhereEdgesAreTaken) {
  Loop loop = sphere_loop(4, 0.2, 0.3);
  loop.taken = {{0, 2}, {1, 3}};
  const Filling filling = fill_any(loop);
  expect_disc(loop, filling);
  ASSERT_EQ(filling.positions.size(), 1U);
  EXPECT_EQ(filling.attributes.size(), 1U);
  EXPECT_NEAR(filling.positions[0][2], std::cos(0.2), 1e-9);
  EXPECT_NEAR(static_cast<double>(filling.normals[0][2]), 1, 1e-6);
}

TEST(FillAny, GivesNoLoneTriangleABack) {
  Loop loop = sphere_loop(3, 0.2, 0.3);
  expect_disc(loop, fill_any(loop));
  loop.facing.assign(3, {0, 0, -1});
  EXPECT_EQ(fill_any(loop).verdict, Verdict::outer_boundary);
}

TEST(Fill, IsOccupiedByVerticesInItOnly) {
  const Loop loop = sphere_loop(12, 0.3, 0.2);
  const Filling filling = fill_loop(loop, 100);
  ASSERT_EQ(filling.verdict, Verdict::filled);
  BoundaryVertex other;
  other.position = {0.02, 0.01, 1.05};
  const FilledPlace place(loop, filling);
  EXPECT_TRUE(place.holds(other));
  other.position = {0.02, 0.01, 0.7};
  EXPECT_FALSE(place.holds(other)) << "another sheet";
  other.position = {0.4, 0.01, 0.9};
  EXPECT_FALSE(place.holds(other)) << "beside it";
}

/// A boundary loop on the saddle z = (x^2 - y^2) / 2, at `radius` from its middle and as noisy as is said.
Loop saddle_loop(std::uint32_t n, double radius, double noise) {
  std::mt19937 random(7);
  std::normal_distribution<> normal;  // a deviation of 0 is none that it knows
  Loop loop = sphere_loop(n, 0.3, 0.1);
  for (std::uint32_t i = 0; i < n; ++i) {
    const double a = kTurn * i / n, d = radius + 2 * noise * normal(random);
    const double x = d * std::cos(a), y = d * std::sin(a);
    const Eigen::Vector3d up = Eigen::Vector3d(-x, y, 1).normalized();
    BoundaryVertex& v = loop.vertices[i];
    v.position = {x, y, (x * x - y * y) / 2 + noise * normal(random)};
    for (std::size_t k = 0; k < 3; ++k) v.normal[k] = static_cast<float>(up[static_cast<Eigen::Index>(k)]);
    loop.facing[i] = {up.x(), up.y(), up.z()};
  }
  return loop;
}

TEST(Fill, OfAWideGapGoesOnAsTheSurfaceDoes) {
  for (const double noise : {0.0, 0.004}) {
    const Loop loop = saddle_loop(300, 0.6, noise);
    const Filling filling = fill_loop(loop, 100);
    expect_disc(loop, filling);
    ASSERT_GT(filling.positions.size(), 300U);
    for (const auto& p : filling.positions) EXPECT_NEAR(p[2], (p[0] * p[0] - p[1] * p[1]) / 2, 1e-3 + 3 * noise);
    EXPECT_LT(filling.positions.size(), 300U * 300 / 12 / 2) << "fewer and larger triangles inside";
  }
}

/// Waves a few dozen edges long, so narrow that they run into each other.
TEST(Fill, OfALongRimThatWindsAndCrossesItself) {
  constexpr std::uint32_t kEdges = 1500;
  Loop loop = saddle_loop(kEdges, 0.6, 0);
  for (std::uint32_t i = 0; i < kEdges; ++i) {
    const double a = kTurn * i / kEdges, b = a + 0.04 * std::sin(kTurn * 75 * i / kEdges);
    const double d = 0.6 + 0.02 * std::cos(kTurn * 75 * i / kEdges);
    const double x = d * std::cos(b), y = d * std::sin(b);
    const Eigen::Vector3d up = Eigen::Vector3d(-x, y, 1).normalized();
    loop.vertices[i].position = {x, y, (x * x - y * y) / 2};
    for (std::size_t k = 0; k < 3; ++k)
      loop.vertices[i].normal[k] = static_cast<float>(up[static_cast<Eigen::Index>(k)]);
    loop.facing[i] = {up.x(), up.y(), up.z()};
  }
  const Filling filling = fill_loop(loop, 1000);
  ASSERT_EQ(filling.verdict, Verdict::filled);
  for (const auto& p : filling.positions) EXPECT_NEAR(p[2], (p[0] * p[0] - p[1] * p[1]) / 2, 0.01);
}

TEST(Fill, OfARimThatLeavesTheSurfaceHereAndThere) {
  Loop loop = saddle_loop(200, 0.6, 0);
  for (std::size_t i = 50; i < 90; ++i) loop.vertices[i].position[2] -= 0.1;
  expect_disc(loop, fill_loop(loop, 100));
  for (std::size_t i = 0; i < 100; ++i) loop.vertices[i].position[2] -= 0.2;
  EXPECT_EQ(fill_loop(loop, 100).verdict, Verdict::bent) << "two surfaces, a step apart";
}

TEST(Fill, NormalsFollowTheTrianglesWhereThoseOfTheRimAreWrong) {
  constexpr double kTilt = 0.3;
  Loop loop = sphere_loop(24, 0.3, 0.2);
  for (BoundaryVertex& v : loop.vertices) {
    v.position[2] = 1;
    v.normal = {static_cast<float>(std::sin(kTilt)), 0, static_cast<float>(std::cos(kTilt))};
  }
  const Filling filling = fill_loop(loop, 100);
  expect_disc(loop, filling);
  ASSERT_GT(filling.positions.size(), 4U);
  double mean = 0;
  for (const auto& n : filling.normals) mean += static_cast<double>(n[2]) / static_cast<double>(filling.normals.size());
  EXPECT_GT(mean, 0.99) << "the rim is flat, the cosine of its normals " << std::cos(kTilt);
}

TEST(Fill, HoleBesideARimIsToldFromOneInTheGap) {
  const Loop rim = sphere_loop(200, 0.5, 0.1);
  EXPECT_TRUE(lies_beside(sphere_loop(12, 0.45, 0.1), rim)) << "a ring along it";
  EXPECT_FALSE(lies_beside(sphere_loop(12, 0.3, 0.1), rim));
}

TEST(Fill, GoesAroundIslands) {
  const Loop outer = saddle_loop(150, 0.6, 0);
  std::vector<Loop> islands;
  for (const double x : {-0.25, 0.3}) {
    Loop island = saddle_loop(40, 0.1, 0);
    for (BoundaryVertex& v : island.vertices) {
      v.position[0] += x;
      v.position[2] = (v.position[0] * v.position[0] - v.position[1] * v.position[1]) / 2;
      const Eigen::Vector3d up = Eigen::Vector3d(-v.position[0], v.position[1], 1).normalized();
      for (std::size_t k = 0; k < 3; ++k) v.normal[k] = static_cast<float>(up[static_cast<Eigen::Index>(k)]);
    }
    reverse(island);
    islands.push_back(island);
  }
  EXPECT_EQ(fill_loop(islands[0], 100).verdict, Verdict::outer_boundary);
  const FilledPlace place(outer, fill_loop(outer, 100));
  EXPECT_TRUE(place.holds(islands[0].vertices[3]));
  EXPECT_TRUE(place.surrounds(islands[0]));
  EXPECT_FALSE(FilledPlace(islands[0], {}).surrounds(outer));
  // An edge from the outer loop to an island, as of two triangles that meet there.
  for (std::size_t i = 0; i < 40; ++i) islands[0].vertices[i].number += 10000;
  islands[0].leaving = {{20, outer.vertices[75].number}};
  const Filling filling = fill_around(outer, {&islands[0], &islands[1]});
  ASSERT_EQ(filling.verdict, Verdict::filled);
  const test::MeshFacts facts = test::check_mesh(filling.triangles);
  EXPECT_TRUE(facts.is_manifold());
  EXPECT_EQ(facts.euler, std::vector<long>{-1}) << "a disc with two holes";
  EXPECT_EQ(facts.boundary.size(), 150U + 40 + 40);
  for (const auto& t : filling.triangles)
    EXPECT_LT(std::count(t.begin(), t.end(), 75U) + std::count(t.begin(), t.end(), 150U + 20), 2);
  for (const auto& p : filling.positions) EXPECT_NEAR(p[2], (p[0] * p[0] - p[1] * p[1]) / 2, 1e-3);
}

}  // namespace
}  // namespace lamina::boundary
