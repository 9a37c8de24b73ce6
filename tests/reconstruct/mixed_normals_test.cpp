// Clouds whose own normals are right but for their signs, as programs leave them that fit planes and stop there.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "lamina/measure.h"
#include "normals/given_normals.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

/// Turns the normals of samples that a rule names.
Cloud turned(Cloud cloud, const std::function<bool(const Point3& p, const Point3& n)>& rule) {
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!rule(cloud.positions[i], cloud.normals[i])) continue;
    for (double& v : cloud.normals[i]) v = -v;
  }
  return cloud;
}

std::function<bool(const Point3&, const Point3&)> by_chance(double share) {
  return [share, random = std::mt19937(5)](const Point3&, const Point3&) mutable {
    return std::uniform_real_distribution<>()(random) < share;
  };
}
bool faces_down(const Point3& /*p*/, const Point3& n) {
  return n[2] < 0;
}
bool in_a_patch(const Point3& p, const Point3& /*n*/) {
  return p[0] > 0.5 && p[1] > 0;
}

/// Both faces of a plate, with noise across.
Cloud plate(double thickness, double noise) {
  std::mt19937 random(2);
  std::uniform_real_distribution<> at(0, 100);
  std::normal_distribution<> error(0, noise);
  Cloud cloud;
  for (int i = 0; i < 20'000; ++i) {
    const double side = i % 2 == 0 ? 1 : -1;
    cloud.add({at(random), at(random), side * thickness / 2 + error(random)}, {0, 0, side});
  }
  return cloud;
}

/// Normals as the differences of noisy samples give them: `share` of a vector that faces anywhere is added to each.
Cloud scattered(Cloud cloud, double share) {
  std::mt19937 random(3);
  std::normal_distribution<> error(0, share);
  for (Point3& n : cloud.normals)
    for (double& v : n) v += error(random);
  return cloud;
}

GivenNormals look(const Cloud& cloud) {
  std::vector<Eigen::Vector3d> at;
  std::vector<Eigen::Vector3f> normals;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    at.emplace_back(cloud.positions[i].data());
    normals.push_back(Eigen::Vector3d(cloud.normals[i].data()).cast<float>());
  }
  return look_at_normals(at, normals);
}

TEST(GivenNormalsLook, OfOneSideAreBelieved) {
  const Cloud sphere = test::sphere_cloud(20'000);
  EXPECT_FALSE(look(sphere).contradict());
  EXPECT_EQ(look(sphere).odd, 0U);
  EXPECT_FALSE(look(turned(sphere, [](const Point3&, const Point3&) { return true; })).contradict()) << "inside out";
}

TEST(GivenNormalsLook, OfThinNoisyWallsAreBelieved) {
  // Spacing 0.7: the faces are as near to each other as samples of one.
  for (const double noise : {0.0, 0.1, 0.3}) {
    const Cloud thin = plate(0.8, noise);
    EXPECT_GT(look(thin).share(), 0.1) << "noise " << noise;
    EXPECT_FALSE(look(thin).contradict()) << "noise " << noise;
    EXPECT_TRUE(look(turned(thin, by_chance(0.5))).contradict()) << "noise " << noise;
  }
}

TEST(GivenNormalsLook, ThatContradictAreNot) {
  const Cloud sphere = test::sphere_cloud(20'000);
  EXPECT_TRUE(look(turned(sphere, by_chance(0.5))).contradict());
  EXPECT_TRUE(look(turned(sphere, by_chance(0.05))).contradict());
  EXPECT_TRUE(look(turned(sphere, faces_down)).contradict());
  EXPECT_TRUE(look(turned(sphere, in_a_patch)).contradict());
}

TEST(GivenNormalsLook, OfFewOrUselessSamplesAreBelieved) {
  EXPECT_FALSE(look(turned(test::sphere_cloud(16), by_chance(0.5))).contradict());
  Cloud nothing = test::sphere_cloud(2'000);
  for (Point3& n : nothing.normals) n = {0, 0, 0};
  EXPECT_EQ(look(nothing).pairs, 0U);
  Cloud one_place = test::sphere_cloud(2'000);
  std::fill(one_place.positions.begin(), one_place.positions.end(), Point3{1, 2, 3});
  EXPECT_FALSE(look(one_place).contradict());
}

SurfaceSettings believing_nothing() {
  SurfaceSettings settings;
  settings.blend.reset();
  settings.close_holes.reset();
  settings.normals.reset();
  return settings;
}

TEST(MixedNormals, GiveTheSurfaceThatTheirAxesMean) {
  const Cloud sphere = test::sphere_cloud(20'000);
  const test::Reconstruction right = reconstruct(sphere, believing_nothing());
  EXPECT_FALSE(right.stats.normals.has_value());
  for (const Cloud& cloud : {turned(sphere, by_chance(0.5)), turned(sphere, faces_down), turned(sphere, in_a_patch)}) {
    const test::Reconstruction r = reconstruct(cloud, believing_nothing());
    ASSERT_TRUE(r.stats.normals.has_value());
    EXPECT_EQ(r.stats.normals->estimated, 0U);
    EXPECT_GT(r.stats.normals->flipped, 0U);
    EXPECT_TRUE(r.facts.is_closed_manifold());
    EXPECT_NEAR(test::area(r.mesh), test::area(right.mesh), 1e-3);
  }
}

/// A cube's; `vertices`: normals are those of its eight vertices, interpolated, not of its faces.
Cloud cube_cloud(std::size_t count, bool vertices) {
  std::mt19937 random(3);
  std::uniform_real_distribution<> u(-1, 1);
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    Point3 p{u(random), u(random), u(random)};
    Point3 face{};
    const std::size_t axis = i % 3;
    p[axis] = face[axis] = i % 2 == 0 ? 1 : -1;
    cloud.add(p, vertices ? p : face);
  }
  return cloud;
}

TEST(MixedNormals, InterpolatedOverFlatFacesAreFoundAgain) {
  const Cloud cloud = cube_cloud(20'000, true);
  EXPECT_TRUE(look(cloud).lean());
  EXPECT_FALSE(look(cube_cloud(20'000, false)).lean());
  EXPECT_FALSE(look(test::sphere_cloud(200'000)).lean()) << "nearly flat as far as neighbours go";
  const test::Reconstruction r = reconstruct(cloud, believing_nothing());
  ASSERT_TRUE(r.stats.normals.has_value());
  EXPECT_EQ(r.stats.normals->estimated, 20'000U);
  EXPECT_TRUE(r.facts.is_closed_manifold());
}

TEST(MixedNormals, OfNoUseAreFoundAgain) {
  Cloud upright = test::sphere_cloud(20'000);
  for (Point3& n : upright.normals) n = {0, 0, 1};
  EXPECT_TRUE(look(upright).lean());
  EXPECT_FALSE(look(test::sphere_cloud(20'000)).lean());
  EXPECT_FALSE(look(turned(test::sphere_cloud(20'000), by_chance(0.5))).lean());
  const test::Reconstruction r = reconstruct(upright, believing_nothing());
  ASSERT_TRUE(r.stats.normals.has_value());
  EXPECT_EQ(r.stats.normals->estimated, 20'000U);
  EXPECT_TRUE(r.facts.is_closed_manifold());
}

TEST(MixedNormals, ThatScatterAreFoundAgain) {
  const Cloud sphere = test::sphere_cloud(20'000);
  EXPECT_LT(look(sphere).disorder, 0.01);
  EXPECT_FALSE(look(scattered(sphere, 0.4)).scatter()) << "noise that is left to later stages";
  EXPECT_FALSE(look(turned(sphere, by_chance(0.5))).scatter()) << "signs do not matter";
  const Cloud noisy = scattered(sphere, 1);
  EXPECT_TRUE(look(noisy).scatter());
  const test::Reconstruction r = reconstruct(noisy, believing_nothing());
  ASSERT_TRUE(r.stats.normals.has_value());
  EXPECT_EQ(r.stats.normals->estimated, 20'000U);
  EXPECT_TRUE(r.facts.is_closed_manifold());
  EXPECT_NEAR(test::area(r.mesh), test::area(reconstruct(sphere, believing_nothing()).mesh), 1e-3);
}

TEST(MixedNormals, StayWhereTheFilesAreAskedFor) {
  SurfaceSettings settings = believing_nothing();
  settings.normals = NormalsChoice::file;
  const test::Reconstruction r = reconstruct(turned(test::sphere_cloud(20'000), by_chance(0.5)), settings);
  EXPECT_FALSE(r.stats.normals.has_value());
}

}  // namespace
}  // namespace lamina
