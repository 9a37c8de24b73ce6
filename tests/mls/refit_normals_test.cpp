// Normals fitted again, against surfaces whose normals are known.
#include "mls/refit_normals.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>

namespace lamina {
namespace {

using Vector = std::array<double, 3>;

constexpr double kUnit = 1e7;  ///< steps

struct RefitScene {
  LocalSamples samples;
  std::vector<Vector> truth;
  double radius = 0;  ///< two spacings, steps

  void add(const Vector& position, const Vector& normal) {
    samples.x.push_back(static_cast<std::int32_t>(std::lround(kUnit * position[0])));
    samples.y.push_back(static_cast<std::int32_t>(std::lround(kUnit * position[1])));
    samples.z.push_back(static_cast<std::int32_t>(std::lround(kUnit * position[2])));
    truth.push_back(normal);
  }
  /// Each component by up to `error` either way.
  float noise = 0;  ///< median angle of the normals to the truth
  void perturb(double error) {
    noise = static_cast<float>(0.68 * error);
    std::mt19937 random(7);
    std::uniform_real_distribution<> u(-error, error);
    for (const Vector& n : truth) {
      const Vector p{n[0] + u(random), n[1] + u(random), n[2] + u(random)};
      const double l = std::hypot(p[0], p[1], p[2]);
      samples.nx.push_back(static_cast<float>(p[0] / l));
      samples.ny.push_back(static_cast<float>(p[1] / l));
      samples.nz.push_back(static_cast<float>(p[2] / l));
    }
  }
};

RefitScene sphere(std::size_t count) {
  std::mt19937 random(3);
  std::normal_distribution<> normal;
  RefitScene scene;
  scene.radius = 2 * kUnit * std::sqrt(4 * std::numbers::pi / static_cast<double>(count));
  for (std::size_t i = 0; i < count; ++i) {
    Vector v{normal(random), normal(random), normal(random)};
    const double l = std::hypot(v[0], v[1], v[2]);
    for (double& c : v) c /= l;
    scene.add(v, v);
  }
  return scene;
}

FilteredNormals refitted(const RefitScene& scene, float support) {
  const auto radius = static_cast<float>(scene.radius);
  RefitNormals refit({support, radius, 0, scene.noise}, {static_cast<std::int32_t>(radius), 4}, select_kernel());
  refit.add(0, scene.samples, std::vector<float>(scene.samples.size(), radius));
  return refit.find(0);
}

/// Root mean square of the angle to the truth.
double error_of(const std::vector<Vector>& truth, const std::vector<float>& x, const std::vector<float>& y,
                const std::vector<float>& z) {
  double sum = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Vector n{static_cast<double>(x[i]), static_cast<double>(y[i]), static_cast<double>(z[i])};
    const double along = n[0] * truth[i][0] + n[1] * truth[i][1] + n[2] * truth[i][2];
    const double across =
        std::hypot(n[0] - along * truth[i][0], n[1] - along * truth[i][1], n[2] - along * truth[i][2]);
    sum += std::pow(std::atan2(across, along), 2);
  }
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

TEST(RefitNormals, OfASphereComeNearTheTruth) {
  RefitScene scene = sphere(6000);
  scene.perturb(0.5);
  const double before = error_of(scene.truth, scene.samples.nx, scene.samples.ny, scene.samples.nz);
  EXPECT_GT(before, 0.3);
  double last = before;
  for (const float support : {2.0F, 4.0F}) {
    const FilteredNormals n = refitted(scene, support);
    const double after = error_of(scene.truth, n.x, n.y, n.z);
    EXPECT_LT(after, 0.6 * last) << support;  // four times the samples: half the error
    last = after;
    for (std::size_t i = 0; i < n.x.size(); ++i) EXPECT_NEAR(std::hypot(n.x[i], n.y[i], n.z[i]), 1, 1e-3);
  }
}

TEST(RefitNormals, OfAnExactSphereStayExact) {
  RefitScene scene = sphere(6000);
  scene.perturb(0);
  for (const float support : {2.0F, 4.0F}) {
    const FilteredNormals n = refitted(scene, support);
    EXPECT_LT(error_of(scene.truth, n.x, n.y, n.z), 2e-3) << support;
  }
}

/// One sample in forty lies outside of the sphere that the others are on.
TEST(RefitNormals, TellHowFarOutsideOfTheirFitSamplesLie) {
  std::mt19937 random(3);
  std::normal_distribution<> normal;
  RefitScene scene;
  constexpr std::size_t kCount = 6000, kEvery = 40;
  scene.radius = 2 * kUnit * std::sqrt(4 * std::numbers::pi / kCount);
  const double raised = 0.3 * scene.radius / kUnit;
  for (std::size_t i = 0; i < kCount; ++i) {
    Vector v{normal(random), normal(random), normal(random)};
    const double l = std::hypot(v[0], v[1], v[2]);
    for (double& c : v) c /= l;
    const double at = i % kEvery == 0 ? 1 + raised : 1;
    scene.add({at * v[0], at * v[1], at * v[2]}, v);
  }
  scene.perturb(0.1);
  const FilteredNormals n = refitted(scene, 3);
  ASSERT_EQ(n.residual.size(), kCount);
  double out = 0, on = 0;
  for (std::size_t i = 0; i < kCount; ++i) (i % kEvery == 0 ? out : on) += static_cast<double>(n.residual[i]);
  const double wanted = 0.3 * scene.radius;
  EXPECT_NEAR(out / (static_cast<double>(kCount) / kEvery), wanted, 0.2 * wanted);
  EXPECT_NEAR(on / (static_cast<double>(kCount) * (kEvery - 1) / kEvery), 0, 0.1 * wanted);
}

/// Half a radius apart and facing away from each other: each side is fitted to its own.
TEST(RefitNormals, OfTwoSidesOfASheet) {
  std::mt19937 random(5);
  std::uniform_real_distribution<> u(-1, 1);
  RefitScene scene;
  const std::size_t count = 4000;
  scene.radius = 2 * kUnit * std::sqrt(4.0 / (count / 2.0));
  for (std::size_t i = 0; i < count; ++i) {
    const double side = i % 2 == 0 ? 1 : -1;
    const double height = 0.25 * side * scene.radius / kUnit;
    scene.add({height, u(random), u(random)}, {side, 0, 0});
  }
  scene.perturb(0.5);
  const double before = error_of(scene.truth, scene.samples.nx, scene.samples.ny, scene.samples.nz);
  const FilteredNormals n = refitted(scene, 3);
  EXPECT_LT(error_of(scene.truth, n.x, n.y, n.z), 0.4 * before);
}

/// Ripples six radii long, up to 19 degrees steep, and normals a few degrees off: a fit over three radii would level
/// them, one over half of that makes the normals better than they came.
TEST(RefitNormals, OfRipplesKeepTheirShape) {
  std::mt19937 random(5);
  std::uniform_real_distribution<> u(-1, 1);
  RefitScene scene;
  constexpr std::size_t kCount = 6000;
  constexpr double kSteepest = 0.35;
  scene.radius = 2 * kUnit * std::sqrt(4.0 / kCount);
  const double wave = 2 * std::numbers::pi / (6 * scene.radius / kUnit);
  for (std::size_t i = 0; i < kCount; ++i) {
    const double x = u(random), y = u(random);
    const double slope = kSteepest * std::cos(wave * x);
    const double l = std::hypot(1, slope);
    scene.add({x, y, kSteepest / wave * std::sin(wave * x)}, {-slope / l, 0, 1 / l});
  }
  scene.perturb(0.12);
  const double before = error_of(scene.truth, scene.samples.nx, scene.samples.ny, scene.samples.nz);
  const FilteredNormals n = refitted(scene, 3);
  EXPECT_LT(error_of(scene.truth, n.x, n.y, n.z), 0.8 * before);
}

/// Two planes at a right angle with exact normals: a fit across the edge would turn those beside it.
TEST(RefitNormals, StayBesideAnEdge) {
  std::mt19937 random(5);
  std::uniform_real_distribution<> u(0, 1);
  RefitScene scene;
  constexpr std::size_t kCount = 4000;
  scene.radius = 2 * kUnit * std::sqrt(2.0 / kCount);
  for (std::size_t i = 0; i < kCount; ++i) {
    const double along = u(random), from_edge = u(random);
    if (i % 2 == 0) {
      scene.add({from_edge, along, 0}, {0, 0, -1});
    } else {
      scene.add({0, along, from_edge}, {-1, 0, 0});
    }
  }
  scene.perturb(0);
  const FilteredNormals n = refitted(scene, 3);
  EXPECT_LT(error_of(scene.truth, n.x, n.y, n.z), 0.03);
}

TEST(RefitNormals, StayWhereTooFewSamplesAreNear) {
  RefitScene scene;
  scene.radius = 0.01 * kUnit;
  for (int i = 0; i < 40; ++i) scene.add({0.1 * i, 0, 0.05 * (i % 3)}, {0, 1, 0});
  scene.perturb(0.3);
  const FilteredNormals n = refitted(scene, 4);
  EXPECT_EQ(n.x, scene.samples.nx);
  EXPECT_EQ(n.y, scene.samples.ny);
  EXPECT_EQ(n.z, scene.samples.nz);
}

/// Buckets that come and go give the normals that all together give, up to the order of sums.
TEST(RefitNormals, DoNotDependOnBuckets) {
  RefitScene scene = sphere(6000);
  scene.perturb(0.5);
  const FilteredNormals whole = refitted(scene, 3);
  const auto radius = static_cast<float>(scene.radius);
  RefitNormals refit({3, radius, 0, scene.noise}, {static_cast<std::int32_t>(radius), 4}, select_kernel());
  constexpr int kBuckets = 20;
  std::array<LocalSamples, kBuckets> buckets;
  std::array<std::vector<std::size_t>, kBuckets> numbers;
  const auto bottom = [](int b) { return -kUnit + 2 * kUnit * b / kBuckets; };
  for (std::size_t i = 0; i < scene.samples.size(); ++i) {
    const LocalSamples& s = scene.samples;
    int b = 0;
    while (b + 1 < kBuckets && s.z[i] >= bottom(b + 1)) ++b;
    LocalSamples& to = buckets[static_cast<std::size_t>(b)];
    to.x.push_back(s.x[i]), to.y.push_back(s.y[i]), to.z.push_back(s.z[i]);
    to.nx.push_back(s.nx[i]), to.ny.push_back(s.ny[i]), to.nz.push_back(s.nz[i]);
    numbers[static_cast<std::size_t>(b)].push_back(i);
  }
  std::size_t added = 0;
  for (std::size_t b = 0; b < kBuckets; ++b) {
    while (added < kBuckets && bottom(static_cast<int>(added)) <= bottom(static_cast<int>(b) + 1) + refit.halo()) {
      refit.add(added, buckets[added], std::vector<float>(buckets[added].size(), radius));
      ++added;
    }
    const FilteredNormals n = refit.find(b);
    refit.forget_below(static_cast<std::int64_t>(bottom(static_cast<int>(b)) - refit.halo()) - 1);
    for (std::size_t i = 0; i < numbers[b].size(); ++i) {
      const std::size_t at = numbers[b][i];
      EXPECT_NEAR(n.x[i], whole.x[at], 1e-4);
      EXPECT_NEAR(n.y[i], whole.y[at], 1e-4);
      EXPECT_NEAR(n.z[i], whole.z[at], 1e-4);
    }
  }
}

}  // namespace
}  // namespace lamina
