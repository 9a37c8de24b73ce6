#include "reconstruct/choose_support.h"

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
  const SupportChoice choice = choose_support({}, survey(0.2F, 2));
  EXPECT_EQ(choice.blend, 1.2);
  EXPECT_EQ(choice.refit, 0);
  EXPECT_EQ(choice.cell, (Length{0.9, Length::Unit::influence_radius}));
}

TEST(ChooseSupport, EvenCleanCloudsGetTheNarrowestSupport) {
  const SupportChoice even = choose_support(by_noise(), survey(0.01F, 2.5F));
  const SupportChoice varying = choose_support(by_noise(), survey(0.01F, 8));
  EXPECT_EQ(even.blend, 1);
  EXPECT_EQ(even.cell.unit, Length::Unit::sample_radius);
  EXPECT_EQ(varying.blend, 1.2);
  EXPECT_EQ(even.refit + varying.refit, 0);
  EXPECT_TRUE(even.thin_cells && even.watertight);
  EXPECT_FALSE(varying.thin_cells || varying.watertight);
}

TEST(ChooseSupport, ClosedMeshesAreMadeWhereAskedFor) {
  SurfaceSettings settings;
  EXPECT_FALSE(choose_support(settings, survey(0.01F, 2)).watertight);
  settings.watertight = true;
  EXPECT_TRUE(choose_support(settings, survey(0.2F, 8)).watertight);
  settings.blend.reset();
  settings.watertight = false;
  EXPECT_FALSE(choose_support(settings, survey(0.01F, 2)).watertight);
}

TEST(ChooseSupport, NoiseWidensTheSupportAndRefitsNormals) {
  double before = 1.2;
  for (const float noise : {0.06F, 0.08F, 0.1F}) {
    const SupportChoice choice = choose_support(by_noise(), survey(noise, 2));
    EXPECT_GT(choice.blend, before);
    EXPECT_GT(choice.refit, 0);
    EXPECT_EQ(choice.cell.unit, Length::Unit::sample_radius);
    before = choice.blend;
  }
  EXPECT_EQ(choose_support(by_noise(), survey(1, 2)).blend, before);
}

TEST(ChooseSupport, GivenNumbersStand) {
  SurfaceSettings settings;
  settings.blend = 1.7;
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).blend, 1.7);
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).refit, 0);
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).cell, (Length{0.9, Length::Unit::influence_radius}));
  settings.blend.reset();
  settings.refit = 0.0;
  settings.cell = Length{0.5, Length::Unit::world};
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).refit, 0);
  EXPECT_EQ(choose_support(settings, survey(0.2F, 2)).cell, *settings.cell);
  EXPECT_GT(choose_support(settings, survey(0.2F, 2)).blend, 2);
  EXPECT_FALSE(choose_support(settings, survey(0.01F, 2)).thin_cells);
}

}  // namespace
}  // namespace lamina
