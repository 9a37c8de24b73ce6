#include "normals/directions.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <vector>

#include "normals/clouds.h"

namespace lamina::normals {
namespace {

using Offsets = std::vector<std::array<float, 3>>;

Plane fit(const Offsets& offsets) {
  Moments m;
  for (const auto& d : offsets) m.add(d);
  return fit_plane(m);
}

/// A flat cloud: axes of the given half lengths, turned at random.
Offsets random_cloud(std::mt19937& random, const std::array<double, 3>& axes, std::size_t n = 12) {
  std::normal_distribution<> normal;
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random)).normalized();
  Offsets offsets;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d p =
        turn * Eigen::Vector3d(axes[0] * normal(random), axes[1] * normal(random), axes[2] * normal(random));
    offsets.push_back({static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())});
  }
  return offsets;
}

void expect_same_as_eigen(const Offsets& offsets) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& d : offsets) mean += Eigen::Vector3d(d[0], d[1], d[2]) / static_cast<double>(offsets.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& d : offsets) {
    const Eigen::Vector3d p = Eigen::Vector3d(d[0], d[1], d[2]) - mean;
    covariance += p * p.transpose() / static_cast<double>(offsets.size());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  const Plane plane = fit(offsets);
  const double scale = solver.eigenvalues()[2];
  EXPECT_NEAR(plane.least, solver.eigenvalues()[0], 1e-9 * scale);
  EXPECT_NEAR(plane.middle, solver.eigenvalues()[1], 1e-7 * scale);
  EXPECT_NEAR(plane.most, scale, 1e-7 * scale);
  // Where the two smaller variances are close, any direction between their axes is as good.
  if (solver.eigenvalues()[1] - solver.eigenvalues()[0] < 1e-3 * scale) return;
  const Eigen::Vector3d normal(plane.normal[0], plane.normal[1], plane.normal[2]);
  EXPECT_NEAR(std::abs(normal.dot(solver.eigenvectors().col(0))), 1, 1e-6);
  EXPECT_NEAR(normal.norm(), 1, 1e-6);
}

TEST(BallMoments, AreThoseOfTheSamplesInside) {
  std::mt19937 random(11);
  std::uniform_int_distribution<std::int32_t> at(-100'000, 100'000);
  std::array<std::vector<std::int32_t>, 3> axes;
  for (int i = 0; i < 3000; ++i) {
    for (auto& axis : axes) axis.push_back(at(random));
  }
  const SampleTree tree(axes[0], axes[1], axes[2]);
  for (std::uint32_t place = 0; place < tree.size(); place += 100) {
    BallMoments ball(tree, place);
    for (const float radius : {10'000.0F, 30'000.0F, 50'000.0F}) {
      Moments expected;
      for (std::uint32_t other = 0; other < tree.size(); ++other) {
        const std::array<float, 3> d = tree.offset(place, other);
        if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= radius * radius) expected.add(d);
      }
      const Moments found = ball.grow_to(radius * radius);
      ASSERT_EQ(found.count, expected.count);
      const double most = expected.count * double{radius} * double{radius};
      for (std::size_t i = 0; i < 3; ++i) ASSERT_NEAR(found.sum[i], expected.sum[i], 1e-6 * most / double{radius});
      for (std::size_t i = 0; i < 6; ++i) ASSERT_NEAR(found.products[i], expected.products[i], 1e-6 * most);
    }
  }
}

TEST(FitPlane, IsTheEigenvectorOfTheLeastVariance) {
  std::mt19937 random(1);
  for (const double thin : {0.0, 1e-6, 1e-3, 0.1, 0.5, 0.9}) {
    for (int i = 0; i < 50; ++i) expect_same_as_eigen(random_cloud(random, {1, 0.9, thin}));
  }
}

RC_GTEST_PROP(FitPlane, DoesNotDependOnTheUnit, (unsigned seed)) {
  std::mt19937 random(seed);
  Offsets offsets = random_cloud(random, {1, 0.7, 0.05});
  const Plane plane = fit(offsets);
  const float unit = *rc::gen::element(0x1p-20F, 0x1p20F, 0x1p29F);
  for (auto& d : offsets) {
    for (float& v : d) v *= unit;
  }
  RC_ASSERT(fit(offsets).normal == plane.normal);
}

TEST(FitPlane, HasNoNormalWithoutAPlane) {
  EXPECT_FALSE(fit({}).valid());
  EXPECT_FALSE(fit({{0, 0, 0}, {1, 0, 0}}).valid());
  EXPECT_FALSE(fit({{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}}).valid());
  EXPECT_FALSE(fit({{0, 0, 0}, {1, 2, 3}, {2, 4, 6}, {-3, -6, -9}}).valid());
}

TEST(FitPlane, IsExactOnCoordinatePlanes) {
  const Plane plane = fit({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {3, -2, 0}});
  EXPECT_EQ(std::abs(plane.normal[2]), 1);
  EXPECT_EQ(plane.least, 0);
}

/// Samples with noise across the surface, and the directions found for them.
struct NoisyCloud {
  test::Oriented truth, noisy;

  void move(double deviation) {
    std::mt19937 random(5);
    std::normal_distribution<> noise(0, deviation);
    noisy = truth;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const double d = noise(random);
      for (std::size_t a = 0; a < 3; ++a) noisy.positions[i][a] += d * truth.normals[i][a];
    }
  }
  /// Root mean square angle to the true lines, degrees, of the samples that `counts` says.
  template <class Counts>
  [[nodiscard]] double error(const Counts& counts) const {
    const test::Found found = test::find_normals(noisy);
    double sum = 0;
    double n = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      if (!counts(truth.positions[i])) continue;
      const double angle = std::acos(std::min(1.0, std::abs(test::dot(truth.normals[i], found.normals[i]))));
      sum += angle * angle;
      n += 1;
    }
    return std::sqrt(sum / n) * 180 / std::numbers::pi;
  }
  [[nodiscard]] double error() const {
    return error([](const test::Vector&) { return true; });
  }
};

// Spacing 0.013: planes of the nearest sixteen are some 10 degrees off with noise of half of it, 30 with twice of it.
TEST(FindDirections, AverageNoiseAway) {
  NoisyCloud cloud;
  test::add_sheet(cloud.truth, 6000, [](double, double) { return 0.0; });
  const auto inside = [](const test::Vector& p) { return std::abs(p[0] - 0.5) < 0.4 && std::abs(p[1] - 0.5) < 0.4; };
  cloud.move(0.006);
  EXPECT_LT(cloud.error(inside), 3);
  cloud.move(0.025);
  EXPECT_LT(cloud.error(inside), 6);
}

TEST(FindDirections, FollowASphereThroughItsNoise) {
  NoisyCloud cloud;
  test::add_sphere(cloud.truth, 20000, 1);
  cloud.move(0.01);
  EXPECT_LT(cloud.error(), 3.5);
  cloud.move(0.04);
  EXPECT_LT(cloud.error(), 7);
}

// A roof of 90 degrees: noise must not round it beyond what it hides.
TEST(FindDirections, KeepAnEdge) {
  NoisyCloud cloud;
  test::add_sheet(cloud.truth, 12000, [](double x, double) { return std::abs(x - 0.5); });
  cloud.move(0.003);
  // A fifth of the density radius from the edge on.
  EXPECT_LT(cloud.error([](const test::Vector& p) { return std::abs(p[0] - 0.5) > 0.03; }), 4.5);
}

// Where noise is little beside the spacing (0.009) the nearest sixteen of a sample beside an edge hold both of its
// sides. What is nearer to it than five deviations lies on either.
TEST(FindDirections, TellTheSidesOfASharpEdgeApart) {
  const auto beside_edge = [](const test::Vector& p) {
    const double off = std::abs(p[0] - 0.5);
    return off > 0.004 && off < 0.015 && std::abs(p[1] - 0.5) < 0.45;
  };
  NoisyCloud roof;
  test::add_sheet(roof.truth, 12000, [](double x, double) { return std::abs(x - 0.5); });
  roof.move(0.0005);
  EXPECT_LT(roof.error(beside_edge), 11) << "20 by the nearest sixteen";
  NoisyCloud ridge;
  test::add_sheet(ridge.truth, 12000, [](double x, double) { return std::hypot(x - 0.5, 0.1); });
  ridge.move(0.0005);
  EXPECT_LT(ridge.error(beside_edge), 2) << "round";
}

// The two faces of a wall four deviations of noise thick: the other one's samples must not turn the plane.
TEST(FindDirections, OfAThinWallAreAcrossIt) {
  NoisyCloud cloud;
  test::add_sheet(cloud.truth, 12000, [](double, double) { return 0.0; });
  test::add_sheet(cloud.truth, 12000, [](double, double) { return 0.03; });
  cloud.move(0.0075);
  EXPECT_LT(cloud.error([](const test::Vector& p) { return std::abs(p[0] - 0.5) < 0.4 && std::abs(p[1] - 0.5) < 0.4; }),
            7);
}

}  // namespace
}  // namespace lamina::normals
