// Clouds that bring normals: checked, turned where they contradict each other, completed where they lack.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>

#include "lamina/normals.h"
#include "normals/clouds.h"

namespace lamina::test {
namespace {

/// A cap of the sphere turned inward.
Oriented flipped_patch(double height, std::size_t& turned) {
  Oriented cloud;
  add_sphere(cloud, 12000, 1);
  turned = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.positions[i][2] < height) continue;
    for (double& v : cloud.normals[i]) v = -v;
    ++turned;
  }
  return cloud;
}

TEST(GivenNormals, CheckTellsOfAFlippedPatch) {
  Oriented sphere;
  add_sphere(sphere, 12000, 1);
  const NormalsSettings check = in_mode(NormalsMode::check);
  EXPECT_EQ(find_normals(sphere, check, true).report.conflicts.conflicts, 0);
  std::size_t turned = 0;
  const Oriented cloud = flipped_patch(0.8, turned);
  const Found found = find_normals(cloud, check, true);
  const SignConflicts c = found.report.conflicts;
  // Links cross the rim of the cap: a strip about a neighbour's distance wide, a few percent of the sphere.
  EXPECT_GT(c.share(), 0.005);
  EXPECT_LT(c.share(), 0.05);
  EXPECT_EQ(found.report.samples, cloud.size());
  EXPECT_EQ(found.report.estimated, 0);
  EXPECT_EQ(compare(cloud, found.normals).right_side, 1);  // nothing changed
}

std::string warning_of(const NormalsReport& report) {
  std::string said;
  RunContext run;
  run.log = [&](LogLevel level, std::string_view text) {
    if (level == LogLevel::warning) said += text;
  };
  warn_of_conflicts(report, "cloud", run);
  return said;
}

TEST(GivenNormals, FlippedPatchesAreWarnedOf) {
  Oriented cloud;
  add_sphere(cloud, 12000, 1);
  EXPECT_EQ(warning_of(find_normals(cloud, in_mode(NormalsMode::check), true).report), "");
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const bool turned = static_cast<int>(std::floor(4 * cloud.positions[i][2])) % 2 == 0;
    for (double& v : cloud.normals[i]) v = turned ? -v : v;
  }
  const NormalsReport report = find_normals(cloud, in_mode(NormalsMode::check), true).report;
  EXPECT_GT(report.conflicts.share(), 0.02);
  EXPECT_THAT(warning_of(report), ::testing::HasSubstr("cloud"));
}

TEST(GivenNormals, AWarningNamesTheWorstSlab) {
  NormalsReport report;
  report.conflicts = {30000, 100};
  report.slabs = {{10000, 0}, {10000, 90}, {10000, 10}};
  EXPECT_EQ(warning_of(report), "");
  report.slabs[1].conflicts = 900;
  EXPECT_THAT(warning_of(report), ::testing::HasSubstr("slab 2 of 3"));
}

TEST(GivenNormals, ReorientingChangesSignsOnly) {
  std::size_t turned = 0;
  Oriented cloud = flipped_patch(0.8, turned);
  const Found found = find_normals(cloud, in_mode(NormalsMode::reorient), true);
  EXPECT_EQ(found.report.flipped, turned);
  EXPECT_EQ(found.report.estimated, 0);
  EXPECT_EQ(found.report.conflicts.conflicts, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const double sign = cloud.positions[i][2] < 0.8 ? 1 : -1;
    for (std::size_t a = 0; a < 3; ++a)
      ASSERT_EQ(found.normals[i][a], static_cast<double>(static_cast<float>(sign * cloud.normals[i][a])));
  }
}

TEST(GivenNormals, CompletingKeepsWhatIsThere) {
  Oriented cloud;
  add_sphere(cloud, 8000, 1);
  const Oriented truth = cloud;
  // Inward ones: the found ones must follow them, not what is outside.
  std::size_t missing = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const bool lacks = cloud.positions[i][0] > 0.5 || i % 7 == 0;
    for (double& v : cloud.normals[i]) v = lacks ? kNan : -v;
    missing += lacks ? 1 : 0;
  }
  const Found found = find_normals(cloud, in_mode(NormalsMode::complete), true);
  EXPECT_EQ(found.report.estimated, missing);
  EXPECT_EQ(found.report.by_given, missing);
  const Quality q = compare(truth, found.normals);
  EXPECT_EQ(q.right_side, 0);
  EXPECT_GT(q.close, 0.99);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (std::isnan(cloud.normals[i][0])) continue;
    for (std::size_t a = 0; a < 3; ++a)
      ASSERT_EQ(found.normals[i][a], static_cast<double>(static_cast<float>(cloud.normals[i][a])));
  }
}

}  // namespace
}  // namespace lamina::test
