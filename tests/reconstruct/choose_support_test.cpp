#include "reconstruct/constants.h"
#include "reconstruct/plan.h"

#include <gtest/gtest.h>

namespace lamina {
namespace {

RadiusSurvey survey(float noise, float high) {
  return {1000, 1, 1.2F, high, noise};
}

/// For samples that come with their normals, or have none.
ReconstructionPlan choice_of(const SurfaceSettings& settings, const RadiusSurvey& survey, const PointSourceInfo& info) {
  ReconstructionPlan plan;
  choose_support(settings, survey, info, plan);
  return plan;
}
ReconstructionPlan choice_of(const SurfaceSettings& settings, const RadiusSurvey& survey, bool found_normals = false) {
  PointSourceInfo info;
  info.found_normals = found_normals;
  return choice_of(settings, survey, info);
}

SurfaceSettings by_noise() {
  SurfaceSettings settings;
  settings.blend.reset();
  return settings;
}

TEST(ChooseSupport, NothingIsChosenUnlessAskedFor) {
  const ReconstructionPlan choice = choice_of({}, survey(0.2F, 2));
  EXPECT_EQ(choice.feed.blend, 1.2);
  EXPECT_EQ(choice.refit.support, 0);
  EXPECT_EQ(choice.feed.cell, (Length{0.9, Length::Unit::influence_radius}));
}

TEST(ChooseSupport, EvenCleanCloudsGetTheNarrowestSupport) {
  const ReconstructionPlan even = choice_of(by_noise(), survey(0.01F, 2.5F));
  const ReconstructionPlan varying = choice_of(by_noise(), survey(0.01F, 8));
  EXPECT_EQ(even.feed.blend, 1);
  EXPECT_EQ(even.feed.cell.unit, Length::Unit::sample_radius);
  EXPECT_EQ(varying.feed.blend, 1.2);
  EXPECT_EQ(even.refit.support + varying.refit.support, 0);
  EXPECT_TRUE(even.feed.refine_sheets);
  EXPECT_FALSE(varying.feed.refine_sheets);
  EXPECT_EQ(even.holes.watertight, Watertight::short_loops);
  EXPECT_EQ(varying.holes.watertight, Watertight::no);
}

TEST(ChooseSupport, PositionsAloneMayHaveWideGaps) {
  EXPECT_EQ(choice_of(by_noise(), survey(0.01F, 2.5F), true).holes.watertight, Watertight::any_loops);
  EXPECT_EQ(choice_of(by_noise(), survey(0.01F, 8), true).holes.watertight, Watertight::no);
  EXPECT_EQ(choice_of(by_noise(), survey(0.2F, 2.5F), true).holes.watertight, Watertight::no);
}

TEST(ChooseSupport, GapsThatNobodySawAreBridged) {
  EXPECT_TRUE(choice_of(by_noise(), survey(0.2F, 8), true).holes.bridge);
  PointSourceInfo info;
  EXPECT_FALSE(choice_of(by_noise(), survey(0.2F, 8), info).holes.bridge);
  info.attributes.push_back({"scan", ScalarType::uint8});
  EXPECT_TRUE(choice_of(by_noise(), survey(0.2F, 8), info).holes.bridge);
  EXPECT_FALSE(choice_of({}, survey(0.2F, 8), info).holes.bridge) << "nothing is chosen unless asked for";
  info.attributes.clear();
  info.scans.resize(2);
  EXPECT_TRUE(choice_of(by_noise(), survey(0.01F, 2), info).holes.bridge);
  SurfaceSettings settings = by_noise();
  settings.bridge = false;
  EXPECT_FALSE(choice_of(settings, survey(0.01F, 2), info).holes.bridge);
  settings = by_noise();
  settings.close_holes = 0;
  EXPECT_FALSE(choice_of(settings, survey(0.01F, 2), info).holes.bridge);
}

TEST(ChooseSupport, ClosedMeshesAreMadeWhereAskedFor) {
  SurfaceSettings settings;
  EXPECT_EQ(choice_of(settings, survey(0.01F, 2)).holes.watertight, Watertight::no);
  settings.watertight = true;
  EXPECT_EQ(choice_of(settings, survey(0.2F, 8)).holes.watertight, Watertight::any_loops);
  settings.blend.reset();
  settings.watertight = false;
  EXPECT_EQ(choice_of(settings, survey(0.01F, 2)).holes.watertight, Watertight::no);
}

TEST(ChooseSupport, NoiseWidensTheSupportAndRefitsNormals) {
  double before = 1.2;
  for (const float noise : {0.06F, 0.1F, kVeryNoisy}) {
    const ReconstructionPlan choice = choice_of(by_noise(), survey(noise, 2));
    EXPECT_GT(choice.feed.blend, before);
    EXPECT_GT(choice.refit.support, 0);
    EXPECT_EQ(choice.feed.cell.unit, Length::Unit::sample_radius);
    before = choice.feed.blend;
  }
  EXPECT_EQ(choice_of(by_noise(), survey(1, 2)).feed.blend, before);
}

TEST(ChooseSupport, RoughNormalsWantTheWideSupportSooner) {
  RadiusSurvey cloud = survey(kVeryNoisyRough, 2);
  const ReconstructionPlan even = choice_of(by_noise(), cloud);
  cloud.normal_noise = 0.25F;  // 14 degrees
  const ReconstructionPlan rough = choice_of(by_noise(), cloud);
  EXPECT_EQ(rough.feed.blend, kVeryNoisyBlend);
  EXPECT_LT(even.feed.blend, rough.feed.blend);
  EXPECT_EQ(rough.refit.support, kRoughRefit);
  EXPECT_EQ(even.refit.support, kNoisyRefit);
}

TEST(ChooseSupport, GivenNumbersStand) {
  SurfaceSettings settings;
  settings.blend = 1.7;
  EXPECT_EQ(choice_of(settings, survey(0.2F, 2)).feed.blend, 1.7);
  EXPECT_EQ(choice_of(settings, survey(0.2F, 2)).refit.support, 0);
  EXPECT_EQ(choice_of(settings, survey(0.2F, 2)).feed.cell, (Length{0.9, Length::Unit::influence_radius}));
  settings.blend.reset();
  settings.refit = 0.0;
  settings.cell = Length{0.5, Length::Unit::world};
  EXPECT_EQ(choice_of(settings, survey(0.2F, 2)).refit.support, 0);
  EXPECT_EQ(choice_of(settings, survey(0.2F, 2)).feed.cell, *settings.cell);
  EXPECT_GT(choice_of(settings, survey(0.2F, 2)).feed.blend, 2);
  EXPECT_FALSE(choice_of(settings, survey(0.01F, 2)).feed.refine_sheets);
}

}  // namespace
}  // namespace lamina
