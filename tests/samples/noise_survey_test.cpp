// Noise against what was put in: samples `spacing` apart, moved along the normal by up to k spacings either way.
#include "samples/sampling_survey.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace lamina {
namespace {

constexpr double kSide = 1e8;  ///< steps

struct Scene {
  LocalSamples samples;
  double radius = 0;  ///< two spacings, steps
};

void add(LocalSamples& samples, double x, double y, double z) {
  samples.x.push_back(static_cast<std::int32_t>(std::lround(x)));
  samples.y.push_back(static_cast<std::int32_t>(std::lround(y)));
  samples.z.push_back(static_cast<std::int32_t>(std::lround(z)));
}

/// A square that stands askew.
Scene noisy_plane(std::size_t count, double k) {
  std::mt19937 random(1);
  std::uniform_real_distribution<> u(-0.5, 0.5);
  const double spacing = kSide / std::sqrt(static_cast<double>(count));
  Scene scene;
  scene.radius = 2 * spacing;
  for (std::size_t i = 0; i < count; ++i) {
    const double along = kSide * u(random), off = 2 * k * spacing * u(random);
    add(scene.samples, 0.8 * along - 0.6 * off, 0.6 * along + 0.8 * off, kSide * u(random));
  }
  return scene;
}

Scene noisy_sphere(std::size_t count, double k) {
  std::mt19937 random(2);
  std::normal_distribution<> normal;
  std::uniform_real_distribution<> u(-0.5, 0.5);
  const double spacing = 0.5 * kSide * std::sqrt(4 * std::numbers::pi / static_cast<double>(count));
  Scene scene;
  scene.radius = 2 * spacing;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = normal(random), y = normal(random), z = normal(random);
    const double to = (0.5 * kSide + 2 * k * spacing * u(random)) / std::hypot(x, y, z);
    add(scene.samples, x * to, y * to, z * to);
  }
  return scene;
}

/// Samples whose scene gives them no normals have none. Tells how many samples were read, where asked.
Noise survey(const Scene& scene, std::size_t buckets, std::uint64_t* samples_read = nullptr) {
  const auto height = static_cast<std::int32_t>(2 * kSide / static_cast<double>(buckets)) + 1;
  SlabStoreWriter writer({}, {::testing::TempDir(), static_cast<std::int32_t>(-kSide), height, buckets, 1 << 20});
  LocalSamples full = scene.samples;
  for (auto* a : {&full.nx, &full.ny, &full.nz}) a->resize(full.size(), 0);
  writer.append(full);
  const SlabStore store = writer.finish();
  const ReadBucket read = [&](std::size_t b, LocalSamples& out) {
    store.read(b, out);
    if (samples_read != nullptr) *samples_read += out.size();
  };
  return survey_noise(store, read, static_cast<float>(scene.radius));
}

double noise_of(const Scene& scene, std::size_t buckets) {
  return static_cast<double>(survey(scene, buckets).distance);
}

/// Of a uniform distribution, half lies within half its reach: k / 2 spacings, k / 4 radii.
constexpr double expected(double k) {
  return k / 4;
}

TEST(SurveyNoise, OfAPlane) {
  EXPECT_LT(noise_of(noisy_plane(20'000, 0), 50), 1e-3);
  for (const double k : {0.1, 0.5, 1.0})
    EXPECT_NEAR(noise_of(noisy_plane(20'000, k), 50), expected(k), 0.15 * expected(k)) << k;
}

TEST(SurveyNoise, SeesAsManyPlacesWhateverTheBucketsSize) {
  const Scene scene = noisy_plane(400'000, 0.5);
  std::uint64_t of_large = 0;
  survey(scene, 24, &of_large);  // 12 with samples
  for (const std::size_t buckets : {48, 96, 240}) {
    std::uint64_t samples = 0;
    survey(scene, buckets, &samples);
    EXPECT_GT(static_cast<double>(samples), 0.8 * static_cast<double>(of_large)) << buckets;
    EXPECT_LT(static_cast<double>(samples), 1.25 * static_cast<double>(of_large)) << buckets;
  }
}

TEST(SurveyNoise, OfASphereIsNotItsCurvature) {
  EXPECT_LT(noise_of(noisy_sphere(20'000, 0), 50), 0.002);
  EXPECT_LT(noise_of(noisy_sphere(1000, 0), 50), 0.02);
  EXPECT_NEAR(noise_of(noisy_sphere(20'000, 0.5), 50), expected(0.5), 0.15 * expected(0.5));
  // Of a spacing either way, the neighbours are those of a place beside the surface.
  EXPECT_NEAR(noise_of(noisy_sphere(20'000, 1), 50), expected(1), 0.3 * expected(1));
}

/// So thick a layer has no plane, and is not mistaken for a clean one.
TEST(SurveyNoise, OfALayerAsThickAsItsNeighbourhoods) {
  for (const double k : {2.0, 4.0}) EXPECT_GT(noise_of(noisy_plane(20'000, k), 50), 0.3) << k;
}

TEST(SurveyNoise, LargeCloudsAreSeenInParts) {
  for (const std::size_t buckets : {8U, 300U})
    EXPECT_NEAR(noise_of(noisy_plane(160'000, 0.5), buckets), expected(0.5), 0.15 * expected(0.5)) << buckets;
}

TEST(SurveyNoise, TellsWhereThereIsMost) {
  Scene scene = noisy_plane(160'000, 0.1);
  std::mt19937 random(3);
  std::uniform_real_distribution<> u(-0.5, 0.5);
  LocalSamples& s = scene.samples;
  // The upper quarter is ten times as noisy.
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (s.z[i] < 0.25 * kSide) continue;
    const double off = scene.radius * u(random);
    s.x[i] -= static_cast<std::int32_t>(0.6 * off);
    s.y[i] += static_cast<std::int32_t>(0.8 * off);
  }
  const Noise noise = survey(scene, 300);
  EXPECT_NEAR(static_cast<double>(noise.distance), expected(0.1), 0.5 * expected(0.1));
  EXPECT_NEAR(static_cast<double>(noise.worst), expected(1), 0.2 * expected(1));
  EXPECT_GT(noise.high, 0.8F * noise.worst);
  EXPECT_NEAR(static_cast<double>(noise.worst_at[2]), 0.375 * kSide, 0.1 * kSide);
}

// Every normal is turned by as much, whichever way it then faces.
TEST(SurveyNoise, OfNormalsIsTheirAngle) {
  for (const double tilt : {0.02, 0.2, 1.0}) {
    Scene scene = noisy_plane(20'000, 0.1);
    LocalSamples& s = scene.samples;
    for (std::size_t i = 0; i < s.size(); ++i) {
      const double side = i % 2 == 0 ? 1 : -1;
      s.nx.push_back(static_cast<float>(side * -0.6 * std::cos(tilt)));
      s.ny.push_back(static_cast<float>(side * 0.8 * std::cos(tilt)));
      s.nz.push_back(static_cast<float>(std::sin(tilt)));
    }
    EXPECT_NEAR(static_cast<double>(survey(scene, 50).angle), tilt, 0.02) << tilt;
  }
}

/// The far side of a thin wall is no noise of the near one.
TEST(SurveyNoise, OfAWallIsThatOfItsSides) {
  Scene wall = noisy_plane(20'000, 0.5);
  LocalSamples& s = wall.samples;
  for (std::size_t i = 0; i < s.size(); ++i) {
    const double side = i % 2 == 0 ? 1 : -1;
    s.x[i] -= static_cast<std::int32_t>(0.3 * side * 0.6 * wall.radius);
    s.y[i] += static_cast<std::int32_t>(0.3 * side * 0.8 * wall.radius);
  }
  EXPECT_GT(noise_of(wall, 50), 1.8 * expected(0.5)) << "without normals nothing tells";
  for (std::size_t i = 0; i < s.size(); ++i) {
    const float side = i % 2 == 0 ? 1 : -1;
    s.nx.push_back(side * -0.6F);
    s.ny.push_back(side * 0.8F);
    s.nz.push_back(0);
  }
  EXPECT_NEAR(noise_of(wall, 50), expected(0.5), 0.15 * expected(0.5));
}

TEST(SurveyNoise, IsZeroWhereNothingTells) {
  EXPECT_EQ(noise_of({}, 3), 0);
  Scene one_place;
  for (int i = 0; i < 500; ++i) add(one_place.samples, 5, 6, 7);
  EXPECT_EQ(noise_of(one_place, 3), 0);
  one_place.radius = 1000;
  EXPECT_EQ(noise_of(one_place, 3), 0);
}

}  // namespace
}  // namespace lamina
