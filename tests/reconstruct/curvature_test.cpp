// The mean curvature of vertices, against surfaces that have a known one.
#include <gtest/gtest.h>

#include <cmath>

#include "lamina/error.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Point3;

std::vector<float> curvatures(const test::Cloud& cloud, test::Reconstruction& out) {
  SurfaceSettings s;
  s.vertex_curvature = true;
  out = test::reconstruct(cloud, s);
  EXPECT_EQ(out.mesh.layout, (AttributeLayout{{"curvature", ScalarType::float32}}));
  return out.mesh.attributes.at(0);
}

TEST(Curvature, OfASphereIsOneOverItsRadius) {
  test::Cloud cloud = test::sphere_cloud(3000);
  for (Point3& p : cloud.positions) {
    for (double& c : p) c *= 4;
  }
  test::Reconstruction r;
  for (const float c : curvatures(cloud, r)) EXPECT_NEAR(static_cast<double>(c), 0.25, 0.005);
}

TEST(Curvature, OfABowlIsNegative) {
  test::Cloud cloud = test::sphere_cloud(3000);
  for (Point3& n : cloud.normals) {
    for (double& c : n) c = -c;
  }
  test::Reconstruction r;
  for (const float c : curvatures(cloud, r)) EXPECT_NEAR(static_cast<double>(c), -1, 0.02);
}

/// A sphere fitted where curvatures differ takes the mean of those towards its few samples: right on the average only.
TEST(Curvature, OfATorusIsItsMeanOnTheAverage) {
  test::Reconstruction r;
  const std::vector<float> found = curvatures(test::torus_cloud(12000), r);
  double sum = 0, squares = 0;
  for (std::size_t v = 0; v < found.size(); ++v) {
    const Point3& p = r.mesh.positions[v];
    const double around = std::hypot(p[0], p[2]);
    const double cosine = (around - test::kTorusMajor) / test::kTorusMinor;
    const double truth = 0.5 * (1 / test::kTorusMinor + cosine / around);
    const double error = static_cast<double>(found[v]) - truth;
    sum += error;
    squares += error * error;
  }
  const auto count = static_cast<double>(found.size());
  EXPECT_NEAR(sum / count, 0, 0.03);
  EXPECT_LT(std::sqrt(squares / count), 0.45);
}

TEST(Curvature, IsRefusedWherePlanesAreFittedOrItIsThereAlready) {
  SurfaceSettings s;
  s.vertex_curvature = true;
  test::Cloud cloud = test::sphere_cloud(500);
  cloud.add_property("curvature", ScalarType::float32, [](const Point3&) { return 0; });
  EXPECT_THROW(test::reconstruct(cloud, s), Error);
  s.fit = FitMode::plane;
  EXPECT_THROW(test::reconstruct(test::sphere_cloud(500), s), Error);
}

}  // namespace
}  // namespace lamina
