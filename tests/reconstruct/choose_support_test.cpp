#include "reconstruct/constants.h"
#include "reconstruct/plan.h"

#include <gtest/gtest.h>

#include <vector>

namespace lamina {
namespace {

RadiusSurvey survey(float noise, float high) {
  return {1000, 1, 1.2F, high, noise};
}

/// For samples that come with their normals, or have none.
ReconstructionPlan choice_of(const SurfaceSettings& settings, const RadiusSurvey& survey, const PointSourceInfo& info,
                             const std::vector<SupportPlace>& support = {}) {
  ReconstructionPlan plan;
  const SupportSurvey supports{support, false};
  choose_support(settings, {survey, is_noisy(survey, supports), supports}, info, plan);
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
  settings.deviation.reset();
  return settings;
}

TEST(ChooseSupport, NothingIsChosenUnlessAskedFor) {
  const ReconstructionPlan choice = choice_of({}, survey(0.2F, 2));
  EXPECT_EQ(choice.feed.blend, 1.2);
  EXPECT_EQ(choice.refit.support, 0);
  EXPECT_EQ(choice.feed.cell, (Length{0.9, Length::Unit::influence_radius}));
}

TEST(ChooseSupport, LittleNoiseIsToldFromDetailByTheSupportsItAsksFor) {
  const SupportSurvey wide{{{{0, 0, 0}, 1.3F}, {{900, 0, 0}, 1.7F}, {{0, 900, 0}, 3}}, false};
  const SupportSurvey narrow{{{{0, 0, 0}, 1.2F}, {{900, 0, 0}, 1.25F}, {{0, 900, 0}, 3}}, false};
  EXPECT_TRUE(is_noisy(survey(0.04F, 2), wide));
  EXPECT_FALSE(is_noisy(survey(0.04F, 2), narrow));
  EXPECT_FALSE(is_noisy(survey(0.04F, 2), {}));
  EXPECT_FALSE(is_noisy(survey(0.02F, 2), wide)) << "a sharp part's scan";
  EXPECT_TRUE(is_noisy(survey(0.06F, 2), narrow));
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
  EXPECT_TRUE(choice_of(by_noise(), survey(0.2F, 8), info).holes.bridge) << "noise is a scanner's";
  EXPECT_FALSE(choice_of(by_noise(), survey(0.01F, 8), info).holes.bridge) << "a surface may end where it does";
  info.attributes.push_back({"scan", ScalarType::uint8});
  EXPECT_TRUE(choice_of(by_noise(), survey(0.01F, 8), info).holes.bridge);
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

TEST(ChooseSupport, NoisySupportsFollowPlaces) {
  const std::vector<SupportPlace> places{{{0, 0, 0}, 1.5F}, {{900, 0, 0}, 2}, {{0, 900, 0}, 2.75F}};
  const ReconstructionPlan choice = choice_of(by_noise(), survey(0.1F, 2), PointSourceInfo{}, places);
  ASSERT_TRUE(choice.feed.support);
  EXPECT_EQ(choice.feed.blend, 2) << "the one in the middle";
  EXPECT_EQ(choice.feed.widest(), 2.75);
  EXPECT_EQ(choice.refit.by_place, choice.feed.support);
  EXPECT_FLOAT_EQ(choice.refit.widest(), kRefitPerBlend * 2.75F);
  EXPECT_EQ(choice.feed.cell, (Length{kNoisyCell, Length::Unit::sample_radius}));
}

TEST(ChooseSupport, NoisyCloudsThatTellNothingGetOneSupport) {
  const ReconstructionPlan choice = choice_of(by_noise(), survey(0.1F, 2));
  EXPECT_FALSE(choice.feed.support);
  EXPECT_EQ(choice.feed.blend, kNoisyBlend);
  EXPECT_GT(choice.refit.support, 0);
}

TEST(ChooseSupport, RoughNormalsWantMoreCompany) {
  RadiusSurvey cloud = survey(0.1F, 2);
  const ReconstructionPlan even = choice_of(by_noise(), cloud);
  cloud.normal_noise = 0.25F;  // 14 degrees
  const ReconstructionPlan rough = choice_of(by_noise(), cloud);
  EXPECT_EQ(even.feed.blend, rough.feed.blend);
  EXPECT_LT(even.refit.support, rough.refit.support);
}

TEST(ChooseSupport, CellsAreFineOnlyWhereFlatPartsAreThinnedOut) {
  SurfaceSettings all = by_noise();
  all.deviation = 0;
  const ReconstructionPlan fine = choice_of(by_noise(), survey(0.1F, 2));
  const ReconstructionPlan coarse = choice_of(all, survey(0.1F, 2));
  EXPECT_LT(fine.feed.cell.value, coarse.feed.cell.value);
  EXPECT_EQ(fine.feed.band_radii, coarse.feed.band_radii) << "as far from the samples";
}

TEST(ChooseSupport, CellsAreAsFineAsTheTrianglesThatAreWantedAskFor) {
  const auto cell_for = [](std::uint64_t triangles, float noise) {
    SurfaceSettings settings = by_noise();
    settings.simplify.triangles = triangles;
    ReconstructionPlan plan;
    plan.samples = 1'000'000;
    choose_support(settings, {survey(noise, 2), is_noisy(survey(noise, 2), {}), {}}, {}, plan);
    return plan.feed.cell.value;
  };
  for (const float noise : {0.01F, 0.1F}) {
    EXPECT_EQ(cell_for(500'000, noise), kChosenCell) << "the full mesh has twice as many";
    EXPECT_LT(cell_for(800'000, noise), 0.8);
    EXPECT_EQ(cell_for(5'000'000, noise), kFinestCell) << "samples tell no more";
  }
}

TEST(ChooseSupport, CellsToldAsAnOptionGiveTheSameBand) {
  const ReconstructionPlan chosen = choice_of(by_noise(), survey(0.1F, 2));
  SurfaceSettings given = by_noise();
  given.cell = chosen.feed.cell;
  const ReconstructionPlan told = choice_of(given, survey(0.1F, 2));
  EXPECT_EQ(told.feed.band_cells, chosen.feed.band_cells);
  EXPECT_EQ(told.feed.band_radii, chosen.feed.band_radii);
  // A cell that knows nothing of the samples has a band of cells.
  given.cell = Length{0.5, Length::Unit::world};
  EXPECT_EQ(choice_of(given, survey(0.1F, 2)).feed.band_cells, FeedSettings{}.band_cells);
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
  EXPECT_EQ(choice_of(settings, survey(0.2F, 2)).feed.blend, kNoisyBlend);
  EXPECT_FALSE(choice_of(settings, survey(0.01F, 2)).feed.refine_sheets);
}

}  // namespace
}  // namespace lamina
