#include "reconstruct/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lamina {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(Findings, WhatWasSeenAndChosen) {
  SurfaceSettings settings;
  settings.blend.reset();
  settings.close_holes.reset();
  SurfaceStats stats;
  stats.plan.samples = 900;
  stats.plan.scans = 3;
  stats.plan.overlap = 0.34;
  stats.plan.radius_low = 1;
  stats.plan.radius_median = 2;
  stats.plan.radius_high = 8;
  stats.plan.noise = 0.1;
  stats.plan.high_noise = 0.25;
  stats.plan.worst_noise = 0.2;
  stats.plan.noisiest = {1, 2, 3};
  stats.plan.blend = 1.5;
  stats.plan.trim = 0.18;
  stats.plan.longest_rim = 300;
  stats.cleaned.lonely = 60;
  stats.cleaned.off_surface = 40;
  const std::string said = describe_findings(settings, stats);
  EXPECT_THAT(said, HasSubstr("900 samples of 3 scans that share 34 % of the places, spacing 1 (0.5 to 4)"));
  EXPECT_THAT(said, HasSubstr("noise 0.1 r, a tenth above 0.25 r, 0.2 r around 1,2,3; normals of the file"));
  EXPECT_THAT(said, HasSubstr("; 100 strays (10 %) left out\nchosen: --blend 1.5 "));
  EXPECT_THAT(said, HasSubstr(" --trim 0.18 --features no --close-holes 300 --watertight no --bridge no"));
}

TEST(Findings, WhereEverythingWasGivenNothingWasChosen) {
  SurfaceStats stats;
  stats.plan.worst_noise = stats.plan.noise = 0.1;
  const std::string said = describe_findings({}, stats);
  EXPECT_THAT(said, Not(HasSubstr("chosen")));
  EXPECT_THAT(said, Not(HasSubstr("around")));
  EXPECT_THAT(said, Not(HasSubstr("scans")));
}

}  // namespace
}  // namespace lamina
