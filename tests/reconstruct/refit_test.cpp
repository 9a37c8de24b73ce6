// What the program chooses by the noise, and normals fitted again, from file to file.
#include <gtest/gtest.h>

#include "reconstruct/clouds.h"
#include "reconstruct/constants.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

/// The unit sphere with uniform noise on each coordinate (in spacings) and normals some 20 degrees off.
/// `right`: spacings of noise where x is positive.
Cloud noisy_sphere(std::size_t count, double spacings, double right) {
  Cloud cloud = test::sphere_cloud(count);
  std::mt19937 random(9);
  std::uniform_real_distribution<> u(-1, 1);
  const double spacing = std::sqrt(4 * std::numbers::pi / static_cast<double>(count));
  for (std::size_t i = 0; i < count; ++i) {
    const double most = spacing * (cloud.positions[i][0] > 0 ? right : spacings);
    for (std::size_t k = 0; k < 3; ++k) {
      cloud.positions[i][k] += most * u(random);
      cloud.normals[i][k] += 0.5 * u(random);
    }
    const double l = test::length(cloud.normals[i]);
    for (double& c : cloud.normals[i]) c /= l;
  }
  return cloud;
}

Cloud noisy_sphere(std::size_t count, double spacings) {
  return noisy_sphere(count, spacings, spacings);
}

class SurfaceRefit : public ::testing::Test {
 protected:
  std::string bytes(SurfaceSettings settings, int threads = 0) {
    if (settings.input.empty()) settings.input = input_;
    settings.output = folder_ / "out.ply";
    RunContext run;
    run.threads = threads;
    plan_ = reconstruct_surface(settings, run).plan;
    return test::read_file(settings.output);
  }
  test::TemporaryFolder folder_;
  const std::string input_ = test::write_cloud(noisy_sphere(8000, 0.5), folder_ / "in.ply");
  SurfacePlan plan_;
};

TEST_F(SurfaceRefit, OnlyWhenAskedFor) {
  const std::string usual = bytes({});
  EXPECT_EQ(plan_.blend, 1.2);
  EXPECT_EQ(plan_.refit, 0);
  EXPECT_EQ(plan_.cell, (Length{0.9, Length::Unit::influence_radius}));
  SurfaceSettings s;
  s.refit = 0;
  s.cell = {0.9, Length::Unit::influence_radius};
  EXPECT_TRUE(bytes(s) == usual) << "what is meant by default, said";
  s.refit = 3;
  EXPECT_FALSE(bytes(s) == usual);
  EXPECT_EQ(plan_.refit, 3);
}

TEST_F(SurfaceRefit, ChoiceIsTheSameForThreadsAndWindows) {
  SurfaceSettings s;
  s.blend.reset();
  s.input = test::write_cloud(noisy_sphere(8000, 0.2, 0.7), folder_ / "uneven.ply");
  const std::string once = bytes(s, 1);
  EXPECT_GT(plan_.noise, 0.09);
  EXPECT_LT(plan_.least_blend, plan_.most_blend);
  EXPECT_DOUBLE_EQ(plan_.refit, static_cast<double>(kRoughRefitPerBlend) * plan_.blend);
  EXPECT_TRUE(once == bytes(s, 2));
  s.window = 3;
  EXPECT_TRUE(once == bytes(s, 2));
}

TEST(SurfaceRefitTruth, MeshComesNearer) {
  const Cloud cloud = noisy_sphere(8000, 0);
  SurfaceSettings s;
  const double kept = test::deviation(test::reconstruct(cloud, s).mesh, test::distance_to_sphere).rms;
  s.refit = 3;
  const double fitted = test::deviation(test::reconstruct(cloud, s).mesh, test::distance_to_sphere).rms;
  EXPECT_LT(fitted, 0.7 * kept);
}

TEST(SurfaceRefitTruth, ChoiceIsBetterThanTheDefaultWithNoise) {
  const Cloud cloud = noisy_sphere(8000, 0.5);
  SurfaceSettings s;
  const double usual = test::deviation(test::reconstruct(cloud, s).mesh, test::distance_to_sphere).rms;
  s.blend.reset();
  const test::Reconstruction chosen = test::reconstruct(cloud, s);
  EXPECT_LT(test::deviation(chosen.mesh, test::distance_to_sphere).rms, 0.6 * usual);
  EXPECT_EQ(chosen.facts.boundary.size(), 0U);
}

TEST(SurfaceRefitTruth, CleanEvenCloudsAreChosenTheNarrowSupport) {
  SurfaceSettings s;
  s.blend.reset();
  const test::Reconstruction chosen = test::reconstruct(test::sphere_cloud(8000), s);
  EXPECT_LT(chosen.stats.plan.noise, 0.01);
  EXPECT_EQ(chosen.stats.plan.blend, 1);
  EXPECT_EQ(chosen.stats.plan.refit, 0);
}

}  // namespace
}  // namespace lamina
