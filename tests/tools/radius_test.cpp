#include "lamina/point_radii.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <numbers>

#include "lamina/surface.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

class RadiusTool : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  SampleBatch rows_ = sphere_rows(20000, 9);
  std::string cloud_ = write_points(folder_ / "cloud.ply", rows_, sphere_columns());
  std::string out_ = folder_ / "out.ply";
};

TEST_F(RadiusTool, FollowsTheDensityAndTheReconstructionsSurvey) {
  ASSERT_EQ(run_lamina({"radius", cloud_, "-o", out_}).code, 0);
  const SampleBatch out = read_points(out_);
  ASSERT_EQ(out.size(), rows_.size());
  EXPECT_EQ(out.x, rows_.x) << "rows keep their order";
  EXPECT_EQ(out.exact, rows_.exact);
  std::vector<float> radii = out.radius;
  std::sort(radii.begin(), radii.end());
  const double median = radii[radii.size() / 2];
  const double spacing = std::sqrt(4 * std::numbers::pi / static_cast<double>(rows_.size()));
  EXPECT_NEAR(median, 2 * spacing, 0.5 * spacing) << "about twice the spacing";

  SurfaceSettings settings;
  settings.input = cloud_;
  settings.dry_run = true;
  const SurfaceStats stats = reconstruct_surface(settings, {});
  // The survey does not bound radii by their neighbours' (RadiiSettings), so its upper end may be longer.
  EXPECT_NEAR(median, stats.plan.radius_median, 0.15 * stats.plan.radius_median);
}

TEST_F(RadiusTool, AReconstructionFromThemIsTheOneWithoutThem) {
  ASSERT_EQ(run_lamina({"radius", cloud_, "-o", out_}).code, 0);
  const std::string own = folder_ / "own.ply", given = folder_ / "given.ply";
  ASSERT_EQ(run_lamina({"surface", cloud_, "-o", own, "--quiet"}).code, 0);
  ASSERT_EQ(run_lamina({"surface", out_, "-o", given, "--quiet"}).code, 0);
  const auto a = static_cast<double>(read_mesh(own).triangles.size());
  const auto b = static_cast<double>(read_mesh(given).triangles.size());
  EXPECT_NEAR(a, b, 0.3 * a);
}

TEST_F(RadiusTool, ScaleAndLimitsActOnEveryRadius) {
  ASSERT_EQ(run_lamina({"radius", cloud_, "-o", out_}).code, 0);
  const auto plain = read_points(out_).radius;
  const auto limited = run_lamina({"radius", cloud_, "--particlescale", "2", "--minradius", "0.09", "--maxradius",
                                   "0.1", "--name", "pscale", "-o", out_});
  ASSERT_EQ(limited.code, 0);
  EXPECT_EQ(open_points(out_)->info().radius_name, "pscale");
  const auto radii = read_points(out_).radius;
  for (std::size_t i = 0; i < radii.size(); ++i) EXPECT_FLOAT_EQ(radii[i], std::clamp(2 * plain[i], 0.09F, 0.1F));
}

TEST_F(RadiusTool, ThreadsMemoryAndPipesDoNotMatter) {
  ASSERT_EQ(run_lamina({"radius", cloud_, "-o", out_, "--threads", "1"}).code, 0);
  const std::string few = folder_ / "few.ply";
  PointRadiiSettings settings;
  settings.memory = 16000;
  RunContext run;
  run.threads = 3;
  const auto source = open_points(cloud_);
  PointColumns columns = columns_of(source->info());
  columns.radius = "radius";
  const auto writer = open_points_writer(few, columns);
  write_point_radii(*source, *writer, settings, run);
  writer->commit();
  EXPECT_TRUE(read_text(out_) == read_text(few));
  const auto piped = run_shell("cat " + test::quoted(cloud_) + " | lamina radius - -o - --quiet");
  EXPECT_TRUE(piped.out == read_text(out_)) << piped.err;
}

TEST_F(RadiusTool, RefusesWhatNeedsMoreMemory) {
  EXPECT_EQ(run_lamina({"radius", cloud_, "-o", out_, "--max-memory", "30M"}).code, 4);
  EXPECT_FALSE(std::filesystem::exists(out_));
}

TEST_F(RadiusTool, WantsNoNormalsAndLeavesBadRowsOut) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 1002\nproperty float x\nproperty float y\nproperty float z\n"
      "end_header\nnan 0 0\n";
  for (std::size_t i = 0; i < 1000; ++i)
    text += std::to_string(rows_.x[i]) + " " + std::to_string(rows_.y[i]) + " " + std::to_string(rows_.z[i]) + "\n";
  write_file(cloud_, text + "0 inf 0\n");
  const auto outcome = run_lamina({"radius", cloud_, "-o", out_});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("2 of 1002 rows are not finite, the first is row 0"));
  const SampleBatch out = read_points(out_);
  EXPECT_EQ(out.size(), 1000U);
  EXPECT_THAT(out.radius, ::testing::Each(::testing::Gt(0.0F)));
  EXPECT_EQ(run_lamina({"radius", cloud_, "--bad-samples", "refuse", "-o", out_}).code, 3);
}

TEST_F(RadiusTool, AnswersMistakesWithTheirCodes) {
  EXPECT_EQ(run_lamina({"radius", cloud_, "--particlescale", "0", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"radius", cloud_, "--minradius", "2", "--maxradius", "1", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"radius", folder_ / "none.ply", "-o", out_}).code, 3);
  write_points(cloud_, {}, {});
  EXPECT_EQ(run_lamina({"radius", cloud_, "-o", out_}).code, 5);
}

}  // namespace
}  // namespace lamina::tools
