#include "reconstruct/choose_support.h"
#include "reconstruct/constants.h"

#include <gtest/gtest.h>

namespace lamina {
namespace {

RadiusSurvey survey(float noise, float high) {
  return {1000, 1, 1.2F, high, noise};
}

SurfaceSettings by_noise() {
  SurfaceSettings settings;
  settings.blend.reset();
  return settings;
}

TEST(ChooseSupport, NothingIsChosenUnlessAskedFor) {
  const StageSettings choice = choose_support({}, survey(0.2F, 2));
  EXPECT_EQ(choice.feed.blend, 1.2);
  EXPECT_EQ(choice.refit.support, 0);
  EXPECT_EQ(choice.feed.cell, (Length{0.9, Length::Unit::influence_radius}));
}

TEST(ChooseSupport, EvenCleanCloudsGetTheNarrowestSupport) {
  const StageSettings even = choose_support(by_noise(), survey(0.01F, 2.5F));
  const StageSettings varying = choose_support(by_noise(), survey(0.01F, 8));
  EXPECT_EQ(even.feed.blend, 1);
  EXPECT_EQ(even.feed.cell.unit, Length::Unit::sample_radius);
  EXPECT_EQ(varying.feed.blend, 1.2);
  EXPECT_EQ(even.refit.support + varying.refit.support, 0);
  EXPECT_TRUE(even.feed.refine_sheets && even.holes.watertight);
  EXPECT_FALSE(varying.feed.refine_sheets || varying.holes.watertight);
}

TEST(ChooseSupport, ClosedMeshesAreMadeWhereAskedFor) {
  SurfaceSettings settings;
  EXPECT_FALSE(choose_support(settings, survey(0.01F, 2)).holes.watertight);
  settings.watertight = true;
  EXPECT_TRUE(choose_support(settings, survey(0.2F, 8)).holes.watertight);
  settings.blend.reset();
  settings.watertight = false;
  EXPECT_FALSE(choose_support(settings, survey(0.01F, 2)).holes.watertight);
}

TEST(ChooseSupport, NoiseWidensTheSupportAndRefitsNormals) {
  double before = 1.2;
  for (const float noise : {0.06F, 0.1F, kVeryNoisy}) {
    const StageSettings choice = choose_support(by_noise(), survey(noise, 2));
    EXPECT_GT(choice.feed.blend, before);
    EXPECT_GT(choice.refit.support, 0);
    EXPECT_EQ(choice.feed.cell.unit, Length::Unit::sample_radius);
    before = choice.feed.blend;
  }
  EXPECT_EQ(choose_support(by_noise(), survey(1, 2)).feed.blend, before);
}

TEST(ChooseSupport, RoughNormalsWantTheWideSupportSooner) {
  RadiusSurvey cloud = survey(kVeryNoisyRough, 2);
  const StageSettings even = choose_support(by_noise(), cloud);
  cloud.normal_noise = 0.25F;  // 14 degrees
  const StageSettings rough = choose_support(by_noise(), cloud);
  EXPECT_EQ(rough.feed.blend, kVeryNoisyBlend);
  EXPECT_LT(even.feed.blend, rough.feed.blend);
  EXPECT_EQ(rough.refit.support, kRoughRefit);
  EXPECT_EQ(even.refit.support, kNoisyRefit);
}

TEST(ChooseSupport, GivenNumbersStand) {
  SurfaceSettings settings;
  settings.blend = 1.7;
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).feed.blend, 1.7);
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).refit.support, 0);
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).feed.cell, (Length{0.9, Length::Unit::influence_radius}));
  settings.blend.reset();
  settings.refit = 0.0;
  settings.cell = Length{0.5, Length::Unit::world};
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).refit.support, 0);
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).feed.cell, *settings.cell);
  EXPECT_GT(choose_support(settings, survey(0.2F, 2)).feed.blend, 2);
  EXPECT_FALSE(choose_support(settings, survey(0.01F, 2)).feed.refine_sheets);
}

}  // namespace
}  // namespace lamina
