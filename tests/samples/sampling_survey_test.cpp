#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "samples/sampling_survey.h"

namespace lamina {
namespace {

SlabStore make_store(const LocalSamples& samples, std::size_t buckets, std::int32_t z_min, std::int32_t height,
                     bool radius = false) {
  StoreLayout layout;
  layout.has_radius = radius;
  SlabStoreWriter writer(layout, {::testing::TempDir(), z_min, height, buckets, 1 << 20});
  LocalSamples full = samples;
  for (auto* a : {&full.nx, &full.ny, &full.nz}) a->assign(full.size(), 0);
  writer.append(full);
  return writer.finish();
}

void add_sample(LocalSamples& samples, double x, double y, double z) {
  samples.x.push_back(static_cast<std::int32_t>(x));
  samples.y.push_back(static_cast<std::int32_t>(y));
  samples.z.push_back(static_cast<std::int32_t>(z));
}

/// A wall along the sweep axis, turned about it: 1 by 4, `n` samples.
LocalSamples wall(std::size_t n, double width, std::mt19937& random) {
  std::uniform_real_distribution<double> u(-0.5, 0.5);
  LocalSamples samples;
  for (std::size_t i = 0; i < n; ++i) {
    const double t = width * u(random);
    add_sample(samples, 0.8 * t, 0.6 * t, 4 * width * u(random));
  }
  return samples;
}

TEST(SurveyRadii, FindsTheSpacingOfAPlane) {
  std::mt19937 random(1);
  const double width = 1e8;
  const std::size_t n = 200'000;
  const auto samples = wall(n, width, random);
  const double truth = 2 * std::sqrt(4 * width * width / static_cast<double>(n));
  for (const std::size_t buckets : {1U, 16U, 256U, 2000U}) {
    const auto height = static_cast<std::int32_t>(4 * width / static_cast<double>(buckets)) + 1;
    const auto store = make_store(samples, buckets, static_cast<std::int32_t>(-2 * width), height);
    const auto whole = survey_radii(store, 10 * n);
    EXPECT_EQ(whole.samples, n);
    EXPECT_NEAR(whole.median, truth, 0.15 * truth);
    EXPECT_LE(whole.low, whole.median);
    EXPECT_LE(whole.median, whole.high);
    const auto part = survey_radii(store, n / 8);
    EXPECT_NEAR(part.median, truth, 0.15 * truth) << buckets;
    EXPECT_LT(part.samples, buckets > 16 ? n / 3 : n + 1);
    EXPECT_GT(part.samples, n / 40);
  }
}

TEST(SurveyRadii, SeesBothEndsOfVaryingDensity) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> u(0, 1);
  LocalSamples samples;
  for (std::size_t i = 0; i < 130'000; ++i) {  // a step of 64
    add_sample(samples, 1e8 * u(random), 1e8 * u(random) * 0.3, i % 65 == 0 ? -1e8 * u(random) : 1e8 * u(random));
    samples.y.back() = samples.x.back() / 3;
  }
  const double dense = 2 * std::sqrt(1e16 * std::sqrt(1 + 1.0 / 9) / 128'000);
  const auto survey = survey_radii(make_store(samples, 100, -100'000'000, 2'000'000), 1'000'000);
  EXPECT_NEAR(survey.median, dense, 0.15 * dense);
  EXPECT_GT(survey.low, dense / 2);
  EXPECT_GT(survey.high, 4 * dense);
  EXPECT_LT(survey.high, 16 * dense);
}

TEST(SurveyRadii, ReportsGivenRadii) {
  LocalSamples samples;
  for (int i = 0; i < 1001; ++i) {
    add_sample(samples, i, i, i);
    samples.radius.push_back(static_cast<float>(1000 - i));
  }
  const auto survey = survey_radii(make_store(samples, 10, 0, 101, true), 5000);
  EXPECT_EQ(survey.samples, 1001U);
  EXPECT_EQ(survey.low, 10);
  EXPECT_EQ(survey.median, 500);
  EXPECT_EQ(survey.high, 990);
}

TEST(SurveyRadii, IsZeroWithoutExtent) {
  LocalSamples samples;
  EXPECT_EQ(survey_radii(make_store(samples, 3, 0, 10), 100).samples, 0U);
  for (int i = 0; i < 500; ++i) add_sample(samples, 5, 6, 7);
  for (const std::uint64_t limit : {1000U, 100U}) {
    const auto survey = survey_radii(make_store(samples, 3, 0, 10), limit);
    EXPECT_EQ(survey.median, 0);
    EXPECT_EQ(survey.high, 0);
  }
}

TEST(SurveyRadii, TakesAFewSamplesAndTheWholeRange) {
  LocalSamples samples;
  add_sample(samples, -2147483648.0, 2147483647.0, -2147483648.0);
  add_sample(samples, 2147483647.0, -2147483648.0, 2147483647.0);
  const auto survey = survey_radii(make_store(samples, 4, -2147483648, 1 << 30), 100);
  EXPECT_EQ(survey.samples, 2U);
  EXPECT_GT(survey.median, 1e9);
}

}  // namespace
}  // namespace lamina
