// Closures invented for boundary loops: always a disc within the rim, smooth where that is known to be right.
#include "boundary/fill.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>

#include "support/mesh_check.h"

namespace lamina::boundary {
namespace {

constexpr double kFullTurn = 2 * std::numbers::pi;
using Place = std::array<double, 3>;

/// A loop through the places, anticlockwise as its closure sees it; `facing`: the surface's normal at each.
template <class PlaceAt, class FacingAt>
Loop loop_through(std::uint32_t n, const PlaceAt& place, const FacingAt& facing) {
  Loop loop;
  for (std::uint32_t i = 0; i < n; ++i) {
    const double t = kFullTurn * i / n;
    BoundaryVertex v;
    v.number = i;
    v.position = place(t);
    const Place normal = facing(t);
    for (std::size_t k = 0; k < 3; ++k) v.normal[k] = static_cast<float>(normal[k]);
    v.radius = 0.1F;
    loop.vertices.push_back(v);
    loop.facing.push_back(normal);
    loop.attributes.push_back(static_cast<float>(v.position[0]));
  }
  return loop;
}

void expect_closure(const Loop& loop, const Filling& filling) {
  ASSERT_EQ(filling.verdict, Verdict::invented);
  const auto n = static_cast<std::uint32_t>(loop.vertices.size());
  const test::MeshFacts facts = test::check_mesh(filling.triangles);
  EXPECT_TRUE(facts.is_manifold());
  EXPECT_EQ(facts.euler, std::vector<long>{1});
  ASSERT_EQ(facts.boundary.size(), n);
  for (const auto& [from, to] : facts.boundary) EXPECT_EQ(to, (from + 1) % n);
  // No chord of the rim: no edge that the mesh may have already.
  for (const auto& t : filling.triangles) {
    EXPECT_TRUE(t[0] >= n || t[1] >= n || t[2] >= n);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k], b = t[(k + 1) % 3];
      EXPECT_TRUE(a >= n || b >= n || b == (a + 1) % n || a == (b + 1) % n);
    }
  }
  EXPECT_EQ(filling.normals.size(), filling.positions.size());
  EXPECT_EQ(filling.attributes.size(), filling.positions.size());
}

TEST(Closure, OfACapGoesOnRound) {
  const double angle = 0.5;
  const auto on_sphere = [&](double t) {
    return Place{std::sin(angle) * std::cos(t), std::sin(angle) * std::sin(t), std::cos(angle)};
  };
  const Loop loop = loop_through(120, on_sphere, on_sphere);
  const Filling filling = close_loop(loop).filling;
  expect_closure(loop, filling);
  for (const auto& p : filling.positions) EXPECT_NEAR(std::hypot(p[0], p[1], p[2]), 1, 0.01);
  for (std::size_t i = 0; i < filling.positions.size(); ++i)
    EXPECT_NEAR(filling.attributes[i], filling.positions[i][0], 0.03);
}

TEST(Closure, OfATubesEndIsFlat) {
  const auto round = [](double t) { return Place{std::cos(t), std::sin(t), 0}; };
  const Loop loop = loop_through(200, round, round);
  const Filling filling = close_loop(loop).filling;
  expect_closure(loop, filling);
  for (const auto& p : filling.positions) EXPECT_NEAR(p[2], 0, 0.05);
}

TEST(Closure, OfASheetLiesBehindIt) {
  // The sheet faces up: its rim is run through clockwise.
  const auto round = [](double t) { return Place{std::cos(-t), std::sin(-t), 0}; };
  const Loop loop = loop_through(200, round, [](double) { return Place{0, 0, 1}; });
  const Filling filling = close_loop(loop).filling;
  expect_closure(loop, filling);
  double lowest = 0;
  for (const auto& p : filling.positions) {
    EXPECT_LT(p[2], 0);
    lowest = std::min(lowest, p[2]);
  }
  EXPECT_NEAR(lowest, -0.5, 0.05) << "half a radius deep";
}

TEST(Closure, GrowsCoarserInwards) {
  const auto round = [](double t) { return Place{std::cos(t), std::sin(t), 0}; };
  const Loop loop = loop_through(2000, round, round);
  const Filling filling = close_loop(loop).filling;
  expect_closure(loop, filling);
  EXPECT_LT(filling.positions.size(), 12'000U);
  double longest = 0;
  for (const auto& t : filling.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto at = [&](std::uint32_t v) {
        return v < 2000 ? loop.vertices[v].position : filling.positions[v - 2000];
      };
      const Place a = at(t[k]), b = at(t[(k + 1) % 3]);
      longest = std::max(longest, std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]));
    }
  }
  EXPECT_LT(longest, 0.7) << "no slivers across";
}

TEST(Closure, OfALongSlitIsMadeOfFairTriangles) {
  const auto slit = [](double t) { return Place{40 * std::cos(t), std::sin(t), 0}; };
  const Loop loop = loop_through(1200, slit, [](double) { return Place{0, 0, 1}; });
  const Filling filling = close_loop(loop).filling;
  expect_closure(loop, filling);
  for (const auto& p : filling.positions) EXPECT_NEAR(p[2], 0, 1e-6);
}

RC_GTEST_PROP(Closure, IsADiscWhateverTheRimLooksLike, ()) {
  const auto n = *rc::gen::inRange<std::uint32_t>(3, 80);
  const auto seed = *rc::gen::arbitrary<std::uint32_t>();
  std::mt19937 random(seed);
  std::uniform_real_distribution<> uniform(-1, 1);
  const auto anywhere = [&](double) { return Place{1e6 + uniform(random), uniform(random), uniform(random)}; };
  const Loop loop = loop_through(n, anywhere, anywhere);
  const Filling filling = close_loop(loop).filling;
  expect_closure(loop, filling);
  for (const auto& p : filling.positions) RC_ASSERT(std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]));
}

}  // namespace
}  // namespace lamina::boundary
