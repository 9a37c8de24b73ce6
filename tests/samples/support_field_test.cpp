#include "samples/support_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace lamina {
namespace {

constexpr double kSpacing = 1000;  // steps

/// A sheet over the yz plane, evenly strewn, that rises by height(z) with noise of so many spacings on it; normals are
/// the sheet's.
template <class Height, class Noise>
LocalSamples sheet(std::size_t n, const Height& height, const Noise& noise) {
  std::mt19937 random(7);
  const double side = std::sqrt(static_cast<double>(n)) * kSpacing;
  std::uniform_real_distribution<double> along(0, side);
  std::normal_distribution<double> error(0, kSpacing);
  LocalSamples s;
  for (std::size_t i = 0; i < n; ++i) {
    const double y = along(random);
    const double z = along(random);
    s.x.push_back(static_cast<std::int32_t>(height(z) + noise(y / side) * error(random)));
    s.y.push_back(static_cast<std::int32_t>(y));
    s.z.push_back(static_cast<std::int32_t>(z));
    const double slope = (height(z + 1) - height(z - 1)) / 2;
    const double length = std::hypot(1, slope);
    s.nx.push_back(static_cast<float>(1 / length));
    s.ny.push_back(0);
    s.nz.push_back(static_cast<float>(-slope / length));
  }
  return s;
}

std::vector<SupportPlace> surveyed(const LocalSamples& samples, std::size_t buckets) {
  const std::int32_t top = *std::max_element(samples.z.begin(), samples.z.end());
  const auto height = static_cast<std::int32_t>(top / static_cast<std::int32_t>(buckets)) + 1;
  SlabStoreWriter writer({}, {::testing::TempDir(), 0, height, buckets, 1 << 20});
  writer.append(samples);
  const SlabStore store = writer.finish();
  return survey_support(store, reader_of(store), survey_radii(store, kSurveySamples), SupportAim::noise).places;
}

/// The median H of the places with y in a part of the sheet's width.
float median_between(const std::vector<SupportPlace>& places, std::size_t n, double low, double high) {
  const double side = std::sqrt(static_cast<double>(n)) * kSpacing;
  std::vector<float> found;
  for (const SupportPlace& p : places) {
    const double share = static_cast<double>(p.at[1]) / side;
    if (share > low && share < high) found.push_back(p.blend);
  }
  EXPECT_GT(found.size(), 50U);
  std::nth_element(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2), found.end());
  return found[found.size() / 2];
}

double flat(double) {
  return 0;
}
/// Waves of sixteen spacings, four high.
double waves(double z) {
  return 2 * kSpacing * std::sin(2 * M_PI / (16 * kSpacing) * z);
}
double even_noise(double) {
  return 0.25;
}
double noise_on_the_right(double share) {
  return share > 0.5 ? 0.6 : 0.1;
}

constexpr std::size_t kSamples = 40'000;

TEST(SurveySupport, FlatNoiseWantsTheWidest) {
  const auto places = surveyed(sheet(kSamples, flat, even_noise), 20);
  EXPECT_GT(median_between(places, kSamples, 0.1, 0.9), 2.4F);
}

TEST(SurveySupport, ShapeWantsNarrowOnes) {
  const auto places = surveyed(sheet(kSamples, waves, even_noise), 20);
  const float blend = median_between(places, kSamples, 0.1, 0.9);
  EXPECT_LT(blend, 2.3F);
  EXPECT_GE(blend, kLeastSupport);
}

TEST(SurveySupport, WiderWhereThereIsMoreNoiseOnTheSameShape) {
  const auto places = surveyed(sheet(kSamples, waves, noise_on_the_right), 20);
  EXPECT_GT(median_between(places, kSamples, 0.6, 0.95), 1.2F * median_between(places, kSamples, 0.05, 0.4));
}

TEST(SurveySupport, BucketsTellNothing) {
  // Places are other ones, since a bucket's samples come together; what they say is about the same.
  const LocalSamples samples = sheet(kSamples, waves, noise_on_the_right);
  const auto few = surveyed(samples, 1);
  const auto many = surveyed(samples, 40'000);  // most of them empty
  for (const double low : {0.1, 0.6}) {
    EXPECT_NEAR(median_between(few, kSamples, low, low + 0.3), median_between(many, kSamples, low, low + 0.3), 0.3);
  }
  EXPECT_LE(many.size(), kSamples / 16 + 1);
}

TEST(SurveySupport, NothingOfFewSamples) {
  EXPECT_TRUE(surveyed(sheet(12, flat, even_noise), 1).empty());
}

std::vector<SupportPlace> strewn(std::size_t n) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> at(-1e6F, 1e6F);
  std::uniform_real_distribution<float> blend(1.2F, 3);
  std::vector<SupportPlace> places;
  for (std::size_t i = 0; i < n; ++i) places.push_back({{at(random), at(random), at(random)}, blend(random)});
  return places;
}

TEST(SupportField, IsAFunctionOfThePointAlone) {
  const SupportField field(strewn(500));
  std::mt19937 random(5);
  std::uniform_int_distribution<std::int32_t> at(-2'000'000, 2'000'000);
  SupportField::Cursor kept(field);
  for (int i = 0; i < 2000; ++i) {
    const std::int32_t x = at(random), y = at(random), z = at(random);
    const float blend = kept.at(x, y, z);
    EXPECT_EQ(blend, SupportField::Cursor(field).at(x, y, z));
    EXPECT_GE(blend, field.least());
    EXPECT_LE(blend, field.most());
  }
}

TEST(SupportField, IsContinuous) {
  const SupportField field(strewn(500));
  SupportField::Cursor cursor(field);
  float before = cursor.at(-1'200'000, 1000, -77);
  for (std::int32_t x = -1'200'000; x < 1'200'000; x += 100) {
    const float here = cursor.at(x, 1000, -77);
    EXPECT_NEAR(here, before, 0.01F) << x;
    before = here;
  }
}

TEST(SupportField, OnePlaceIsEverywhere) {
  const SupportField field({{{5, 5, 5}, 1.75F}});
  EXPECT_EQ(SupportField::Cursor(field).at(-100'000, 3, 1 << 30), 1.75F);
  EXPECT_EQ(field.median(), 1.75F);
}

}  // namespace
}  // namespace lamina
