// Input, output and settings that cannot work: one line that names the file and the place, and nothing left behind.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>

#include "lamina/error.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

class SurfaceBadInput : public ::testing::Test {
 protected:
  SurfaceBadInput() {
    std::filesystem::create_directory(folder_ / "tmp");
    test::write_file(output_, "an older mesh");
  }
  /// The job fails as it should, with one line holding every word; the older output and both folders are as before.
  void expect_failure(ExitCode code, const std::vector<std::string>& words, SurfaceSettings s, RunContext run = {}) {
    if (s.output.empty()) s.output = output_;
    if (run.tmp_dir.empty()) run.tmp_dir = folder_ / "tmp";
    const long before = folder_.entries();
    try {
      reconstruct_surface(s, run);
      ADD_FAILURE() << "no error";
    } catch (const Error& e) {
      const std::string said = e.what();
      EXPECT_EQ(e.code(), code) << said;
      EXPECT_EQ(said.find('\n'), std::string::npos) << said;
      for (const std::string& word : words) EXPECT_THAT(said, HasSubstr(word));
    }
    EXPECT_EQ(folder_.entries(), before);
    EXPECT_TRUE(std::filesystem::is_empty(folder_ / "tmp"));
    EXPECT_EQ(test::read_file(output_), "an older mesh");
  }
  void expect_failure(ExitCode code, const std::vector<std::string>& words, const std::string& input) {
    SurfaceSettings s;
    s.input = input;
    expect_failure(code, words, s);
  }
  void expect_failure(ExitCode code, const std::vector<std::string>& words, const Cloud& cloud) {
    expect_failure(code, words, test::write_cloud(cloud, folder_ / "in.ply"));
  }

  test::TemporaryFolder folder_;
  const std::string output_ = folder_ / "out.ply";
};

TEST_F(SurfaceBadInput, FilesThatAreNoClouds) {
  expect_failure(ExitCode::unreadable, {"none.ply", "No such file"}, folder_ / "none.ply");
  expect_failure(ExitCode::unreadable, {"none", "no point files"}, [&] {
    std::filesystem::create_directory(folder_ / "none");
    return folder_ / "none";
  }());
  expect_failure(ExitCode::unreadable, {"empty.ply", "empty"}, test::write_file(folder_ / "empty.ply", ""));
  expect_failure(ExitCode::unreadable, {"text.ply", "no point file"}, test::write_file(folder_ / "text.ply", "hello"));
}

TEST_F(SurfaceBadInput, FilesCutShortAnywhere) {
  const Cloud cloud = test::sphere_cloud(500);
  for (const PlyFormat format : {PlyFormat::ascii, PlyFormat::little_endian, PlyFormat::big_endian}) {
    const std::string whole = test::ply_bytes(test::ply_model(cloud), format);
    for (const double share : {0.0005, 0.005, 0.3, 0.999}) {
      const auto length = static_cast<std::size_t>(share * static_cast<double>(whole.size()));
      expect_failure(ExitCode::unreadable, {"cut.ply"}, test::write_file(folder_ / "cut.ply", whole.substr(0, length)));
    }
  }
}

TEST_F(SurfaceBadInput, HeadersThatLie) {
  const Cloud cloud = test::sphere_cloud(500);
  for (const PlyFormat format : {PlyFormat::ascii, PlyFormat::little_endian, PlyFormat::big_endian}) {
    for (const char* count : {"501", "499", "4000000000", "18446744073709551615", "-1", "many"}) {
      std::string text = test::ply_bytes(test::ply_model(cloud), format);
      text.replace(text.find("vertex 500"), 10, std::string("vertex ") + count);
      expect_failure(ExitCode::unreadable, {"lie.ply"}, test::write_file(folder_ / "lie.ply", text));
    }
  }
}

TEST_F(SurfaceBadInput, NoNormals) {
  test::PlyModel model = test::ply_model(test::sphere_cloud(100));
  model.elements[0].columns.resize(3);
  for (auto& row : model.elements[0].cells) row.resize(3);
  SurfaceSettings s;
  s.normals = NormalsChoice::file;
  s.input = test::write_file(folder_ / "in.ply", test::ply_bytes(model, PlyFormat::ascii));
  expect_failure(ExitCode::unreadable, {"in.ply", "no normals", "nx ny nz", "--normals auto"}, s);
}

TEST_F(SurfaceBadInput, PositionsThatTellNoNormal) {
  SurfaceSettings s;
  s.input = test::write_file(folder_ / "in.xyz", "0 0 0\n1 0 0\n2 0 0\n3 0 0\n");
  expect_failure(ExitCode::empty, {"in.xyz", "none of its 4 samples", "on a line"}, s);
}

TEST_F(SurfaceBadInput, AFileIsNotRefusedForNormalsItDoesNotHave) {
  std::string rows;
  const Cloud cloud = test::sphere_cloud(5000);
  for (const Point3& p : cloud.positions) rows += fmt::format("{} {} {}\n", p[0], p[1], p[2]);
  for (int i = 0; i < 100; ++i) rows += fmt::format("{} 5 5\n", 5 + 0.01 * i);
  SurfaceSettings s;
  s.bad_samples = BadSamples::refuse;
  s.input = test::write_file(folder_ / "in.xyz", rows);
  s.output = folder_ / "out.ply";
  const SurfaceStats stats = reconstruct_surface(s, {});
  EXPECT_GT(stats.triangles, 1000U);
  ASSERT_FALSE(stats.rejected.empty());
  EXPECT_EQ(stats.rejected[0].reason, "normal that its neighbours do not tell");
}

TEST_F(SurfaceBadInput, TooFewPlaces) {
  Cloud cloud;
  expect_failure(ExitCode::empty, {"in.ply", "no points"}, cloud);
  cloud.add({1, 2, 3}, {0, 0, 1});
  expect_failure(ExitCode::empty, {"in.ply", "only one usable sample"}, cloud);
  for (int i = 1; i < 1000; ++i) cloud.add({1, 2, 3}, {0, 0, 1});
  expect_failure(ExitCode::empty, {"in.ply", "all 1000 usable samples lie at one place"}, cloud);
  Cloud two;
  two.add({0, 0, 0}, {0, 0, 1});
  two.add({1, 0, 0}, {0, 0, 1});
  expect_failure(ExitCode::empty, {"in.ply", "no surface came out of 2 samples"}, two);
}

TEST_F(SurfaceBadInput, NoUsableSample) {
  Cloud cloud = test::sphere_cloud(10);
  for (Point3& p : cloud.positions) p[1] = kNan;
  expect_failure(ExitCode::empty, {"in.ply", "none of its 10 samples is usable"}, cloud);
  cloud = test::sphere_cloud(10);
  for (Point3& n : cloud.normals) n = {0, 0, 0};
  SurfaceSettings s;
  s.normals = NormalsChoice::file;
  s.input = test::write_cloud(cloud, folder_ / "in.ply");
  expect_failure(ExitCode::empty, {"in.ply", "none of its 10 samples has a normal", "--normals auto"}, s);
}

TEST_F(SurfaceBadInput, CoordinatesTooLargeToSquare) {
  Cloud cloud = test::sphere_cloud(100);
  for (Point3& p : cloud.positions) p[2] *= 1e200;
  expect_failure(ExitCode::unreadable, {"in.ply", "2e+200"},
                 test::write_cloud(cloud, folder_ / "in.ply", PlyFormat::ascii, ScalarType::float64));
}

TEST_F(SurfaceBadInput, AFarOutlierIsNamedAsTheReason) {
  Cloud cloud = test::sphere_cloud(3000);
  cloud.add({1e9, 0, 0}, {1, 0, 0});
  expect_failure(ExitCode::empty, {"in.ply", "far away from the others"}, cloud);
}

TEST_F(SurfaceBadInput, RefusedSamplesAreNamedByRow) {
  SurfaceSettings s;
  s.bad_samples = BadSamples::refuse;
  s.input = folder_ / "in.ply";
  Cloud cloud = test::sphere_cloud(100);
  cloud.positions[17][2] = kInfinity;
  test::write_cloud(cloud, s.input);
  expect_failure(ExitCode::unreadable, {"in.ply", "non-finite position", "row 17", "--bad-samples drop"}, s);
}

TEST_F(SurfaceBadInput, OutputsThatCannotBeWritten) {
  SurfaceSettings s;
  s.input = test::write_cloud(test::sphere_cloud(500), folder_ / "in.ply");
  s.output = folder_ / "missing/out.ply";
  expect_failure(ExitCode::budget, {s.output, "does not exist"}, s);
  s.output = folder_ / "tmp";
  expect_failure(ExitCode::budget, {s.output, "directory"}, s);
  s.output = "/dev/full";
  expect_failure(ExitCode::budget, {"/dev/full", "No space left", "free some space"}, s);
  s.output = "/proc/lamina.ply";
  expect_failure(ExitCode::budget, {s.output}, s);
  s.output = s.input;
  const std::string before = test::read_file(s.input);
  expect_failure(ExitCode::usage, {s.input, "input and output", "--output"}, s);
  EXPECT_EQ(test::read_file(s.input), before);
}

TEST_F(SurfaceBadInput, AnUnwritableOutputIsFoundBeforeTheInputIsRead) {
  SurfaceSettings s;
  s.input = folder_ / "none.ply";
  s.output = folder_ / "missing/out.ply";
  expect_failure(ExitCode::budget, {s.output}, s);
}

TEST_F(SurfaceBadInput, TemporaryFolderMissing) {
  SurfaceSettings s;
  s.input = test::write_cloud(test::sphere_cloud(500), folder_ / "in.ply");
  RunContext run;
  run.tmp_dir = folder_ / "no-such-folder";
  expect_failure(ExitCode::budget, {run.tmp_dir, "temporary"}, s, run);
}

TEST_F(SurfaceBadInput, SettingsOutOfRange) {
  const std::string input = test::write_cloud(test::sphere_cloud(500), folder_ / "in.ply");
  const std::vector<std::pair<std::string, std::function<void(SurfaceSettings&)>>> wrong{
      {"--blend", [](auto& s) { s.blend = 0; }},
      {"--blend", [](auto& s) { s.blend = kNan; }},
      {"--steps", [](auto& s) { s.steps = 17; }},
      {"--levels", [](auto& s) { s.levels = 13; }},
      {"--density", [](auto& s) { s.density = 1; }},
      {"--particlescale", [](auto& s) { s.radius_scale = -1; }},
      {"--cell",
       [](auto& s) {
         s.cell = {0, Length::Unit::sample_radius};
       }},
      {"--cell",
       [](auto& s) {
         s.cell = {1e-9, Length::Unit::world};
       }},
      {"--cell",
       [](auto& s) {
         s.cell = {1e9, Length::Unit::world};
       }},
      {"--boundary", [](auto& s) { s.boundary = -1; }},
      {"--chord", [](auto& s) { s.chord = 2; }},
      {"--window", [](auto& s) { s.window = 0; }},
  };
  for (const auto& [option, change] : wrong) {
    SurfaceSettings s;
    s.input = input;
    change(s);
    expect_failure(ExitCode::usage, {option}, s);
  }
}

TEST_F(SurfaceBadInput, CancelledAnywhereLeavesNothing) {
  SurfaceSettings s;
  s.input = test::write_cloud(test::sphere_cloud(30000), folder_ / "in.ply");
  for (const std::string stage : {"survey", "read", "surface"}) {
    std::atomic<bool> cancel = false;
    RunContext run;
    run.cancel = &cancel;
    run.progress = [&](const Progress& p) { cancel = cancel || p.stage == stage; };
    expect_failure(ExitCode::internal, {"cancelled"}, s, run);
    EXPECT_TRUE(cancel) << stage;
  }
}

TEST_F(SurfaceBadInput, MemoryBeyondTheBudgetIsRefusedBeforeTheSweep) {
  SurfaceSettings s;
  s.input = test::write_cloud(test::sphere_cloud(30000), folder_ / "in.ply");
  s.window = 16;
  s.dry_run = true;
  SurfacePlan plan = reconstruct_surface(s, {}).plan;
  ASSERT_GT(plan.memory_bytes, 0u);
  s.dry_run = false;
  RunContext run;
  run.max_memory = static_cast<std::size_t>(plan.memory_bytes - 1);
  bool swept = false;
  run.progress = [&](const Progress& p) { swept = swept || p.stage == "surface"; };
  expect_failure(ExitCode::budget, {"in.ply", "--max-memory allows", "--window 1 would fit"}, s, run);
  run.max_memory = 1000;
  expect_failure(ExitCode::budget, {"in.ply", "needs about", "give it more"}, s, run);
  EXPECT_FALSE(swept);
  s.output = output_;
  run.max_memory = static_cast<std::size_t>(plan.memory_bytes);
  reconstruct_surface(s, run);
  EXPECT_TRUE(swept);
}

}  // namespace
}  // namespace lamina
