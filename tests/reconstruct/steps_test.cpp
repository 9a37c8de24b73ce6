// Corners that say themselves how many projection steps they need.
#include <gtest/gtest.h>

#include "reconstruct/clouds.h"

namespace lamina {
namespace {

TEST(Steps, AutoIsAsGoodAsManyAndLessWork) {
  const test::Cloud cloud = test::torus_cloud(4000);
  const auto run = [&](int steps, double tolerance) {
    SurfaceSettings s;
    s.fit = FitMode::plane;
    s.blend = 2;
    s.steps = steps;
    s.step_tolerance = tolerance;
    return test::reconstruct(cloud, s);
  };
  const auto one = run(1, 0.01), many = run(8, 0.01), fine = run(0, 0.002), coarse = run(0, 0.05);
  const auto error = [](const auto& r) { return test::deviation(r.mesh, test::distance_to_torus).rms; };
  EXPECT_NEAR(error(fine), error(many), 0.01 * error(many));
  EXPECT_LT(fine.stats.corner_sums, many.stats.corner_sums);
  EXPECT_LT(coarse.stats.corner_sums, fine.stats.corner_sums);
  EXPECT_GT(coarse.stats.corner_sums, one.stats.corner_sums);
  EXPECT_GE(one.stats.corner_sums, one.stats.corners);
}

}  // namespace
}  // namespace lamina
