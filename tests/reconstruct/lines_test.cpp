// Samples on lines far apart, as profile scanners and echo sounders leave them, from positions alone.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "lamina/measure.h"
#include "reconstruct/clouds.h"
#include "samples/all_round.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

constexpr double kStep = 0.02;  ///< along a line

double height(double x, double y) {
  return 2 * std::sin(x / 7) + std::cos(y / 3);
}
double distance_to_ground(const Point3& p) {
  const double along = 2. / 7 * std::cos(p[0] / 7), across = std::sin(p[1] / 3) / 3;
  return std::abs(p[2] - height(p[0], p[1])) / std::sqrt(1 + along * along + across * across);
}

/// Ground in profiles so many steps apart. Noise (steps) is along the scanner's rays: it leaves a profile's plane
/// alone.
Cloud profiles(int apart, double noise) {
  constexpr double kLong = 30, kWide = 16;
  std::mt19937 random(3);
  std::uniform_real_distribution<> begin(0, kStep);
  std::normal_distribution<> error(0, kStep);
  Cloud cloud;
  for (double y = 0; y < kWide; y += apart * kStep) {
    for (double x = begin(random); x < kLong; x += kStep)
      cloud.add({x + noise * error(random), y, height(x, y) + noise * error(random)}, {});
  }
  return cloud;
}

SurfaceSettings chosen() {
  SurfaceSettings settings;
  settings.blend.reset();
  settings.deviation.reset();
  settings.trim.reset();
  settings.refit.reset();
  settings.prune_triangles.reset();
  settings.clean.strays = true;
  settings.close_holes.reset();
  settings.normals = NormalsChoice::estimate;
  return settings;
}

class Profiles : public ::testing::TestWithParam<std::pair<int, double>> {};

TEST_P(Profiles, AreOneSurface) {
  const auto [apart, noise] = GetParam();
  const test::Reconstruction r = reconstruct(profiles(apart, noise), chosen());
  EXPECT_TRUE(r.stats.plan.lines);
  EXPECT_TRUE(r.facts.is_manifold());
  EXPECT_EQ(r.facts.euler.size(), 1U);
  EXPECT_LE(lamina::check_mesh(r.mesh).boundary_loops, 2U);
  EXPECT_GT(test::area(r.mesh), 0.98 * 30 * 15.5);
  const test::Deviation from = test::deviation(r.mesh, distance_to_ground);
  EXPECT_LT(from.rms, (0.6 * noise + 0.015 * apart) * kStep);
}

INSTANTIATE_TEST_SUITE_P(Lines, Profiles,
                         ::testing::Values(std::pair(12, 0.0), std::pair(20, 0.2), std::pair(30, 1.0),
                                           std::pair(40, 0.0)));

TEST(Lines, AreNotSeenWhereThereAreNone) {
  EXPECT_FALSE(reconstruct(profiles(3, 0), chosen()).stats.plan.lines);
  EXPECT_FALSE(reconstruct(test::sphere_cloud(20000), chosen()).stats.plan.lines);
}

TEST(AllRound, IsAsFarAsTheLastSide) {
  AllRound sides;
  for (const float x : {1.0F, 2.0F, -1.0F, -2.0F}) sides.add(x, 0);
  EXPECT_TRUE(std::isinf(sides.distance()));
  sides.add(0, 3);
  EXPECT_TRUE(std::isinf(sides.distance()));
  sides.add(0.1F, -5);
  EXPECT_NEAR(sides.distance(), 5, 0.01);
  sides.add(0, -4);
  EXPECT_NEAR(sides.distance(), 4, 1e-6);
}

}  // namespace
}  // namespace lamina
