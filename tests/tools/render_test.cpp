#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "lamina/mesh.h"
#include "render/shapes.h"
#include "support/program.h"

namespace lamina::tools {
namespace {

using test::run_lamina;
using ::testing::HasSubstr;

class RenderTool : public ::testing::Test {
 protected:
  RenderTool() {
    write_mesh(test::sphere(1, 12), mesh_);
    std::ofstream(cloud_)
        << "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
           "end_header\n0 0 0\n1 0 0\n0 1 0\n";
  }
  test::TemporaryFolder folder_;
  std::string mesh_ = folder_ / "sphere.ply", cloud_ = folder_ / "cloud.ply", picture_ = folder_ / "out.png";
};

TEST_F(RenderTool, DrawsMeshesAndPoints) {
  for (const std::string& input : {mesh_, cloud_}) {
    const auto outcome =
        run_lamina({"render", input, "-o", picture_, "--size", "64x48", "--view", "-30,45", "--quiet"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    EXPECT_EQ(test::read_text(picture_).substr(1, 3), "PNG");
    std::filesystem::remove(picture_);
  }
}

TEST_F(RenderTool, WritesToStandardOutput) {
  const auto outcome = run_lamina({"render", mesh_, "-o", "-", "--size", "16x16"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.out.substr(1, 3), "PNG");
}

TEST_F(RenderTool, CountsTheBoundary) {
  const auto outcome = run_lamina({"render", mesh_, "-o", picture_, "--mark-boundary"});
  EXPECT_THAT(outcome.err, HasSubstr("marked 0 boundary edges"));
}

TEST_F(RenderTool, WarnsOfAnEmptyPicture) {
  const auto outcome = run_lamina({"render", mesh_, "-o", picture_, "--zoom", "50,0,0,1", "--quiet"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("nothing of it is in the picture"));
}

TEST_F(RenderTool, AnswersBadOptions) {
  const std::vector<std::vector<std::string>> wrong{
      {"--size", "0x5"}, {"--size", "64"},      {"--view", "1,2,3"},    {"--view", "1,91"},      {"--zoom", "0,0,0,-1"},
      {"--up", "w"},     {"--colour", "mauve"}, {"--supersample", "0"}, {"--point-radius", "-1"}};
  for (const auto& options : wrong) {
    std::vector<std::string> words{"render", mesh_, "-o", picture_};
    words.insert(words.end(), options.begin(), options.end());
    const auto outcome = run_lamina(words);
    EXPECT_EQ(outcome.code, 2) << options[0] << ' ' << options[1] << ": " << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(picture_));
  }
  EXPECT_THAT(run_lamina({"render", mesh_, "-o", picture_, "--sise", "4x4"}).err, HasSubstr("did you mean '--size'?"));
}

TEST_F(RenderTool, DrawsVolumes) {
  const std::string volume = folder_ / "sphere.vdb", points = folder_ / "points.vdb";
  ASSERT_EQ(run_lamina({"convert", mesh_, "-o", volume, "--voxelsize", "0.1"}).code, 0);
  ASSERT_EQ(run_lamina({"convert", cloud_, "-o", points}).code, 0);
  const auto level_set = run_lamina({"render", volume, "-o", picture_, "--size", "48x48"});
  EXPECT_EQ(level_set.code, 0) << level_set.err;
  EXPECT_THAT(level_set.err, HasSubstr("drew level set surface, voxels of 0.1"));
  const auto lines = run_lamina({"render", volume, "-o", picture_, "--size", "48x48", "--wireframe"});
  EXPECT_THAT(lines.err, HasSubstr("triangles"));
  EXPECT_THAT(run_lamina({"render", points, "-o", picture_, "--size", "48x48"}).err, HasSubstr("drew 3 points"));
  const std::string fog = folder_ / "fog.vdb";
  ASSERT_EQ(run_lamina({"convert", volume, "--fog", "-o", fog}).code, 0);
  const auto smoke = run_lamina({"render", fog, "-o", picture_, "--size", "48x48"});
  EXPECT_EQ(smoke.code, 0) << smoke.err;
  EXPECT_THAT(smoke.err, HasSubstr("drew fog density, voxels of 0.1"));
  const auto refused = run_lamina({"render", fog, "-o", folder_ / "fog.png", "--wireframe"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("a fog has no triangles"));
  EXPECT_EQ(run_lamina({"render", volume, "--grid", "none", "-o", picture_}).code, 3);
}

TEST_F(RenderTool, WritesTheFramesOfATurn) {
  const auto outcome = run_lamina({"render", mesh_, "-o", picture_, "--size", "16x16", "--frames", "3", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  for (const char* name : {"out.0001.png", "out.0002.png", "out.0003.png"})
    EXPECT_EQ(test::read_text(folder_ / name).substr(1, 3), "PNG");
  EXPECT_FALSE(std::filesystem::exists(picture_));
  EXPECT_EQ(run_lamina({"render", mesh_, "-o", "-", "--frames", "3"}).code, 2);
  EXPECT_EQ(run_lamina({"render", mesh_, "-o", mesh_}).code, 2) << "a picture called mesh";
}

TEST_F(RenderTool, PaintsDistancesAndAttributes) {
  const std::string truth = folder_ / "truth.ply";
  write_mesh(test::sphere(0.75, 60), truth);
  const auto distance = run_lamina({"render", mesh_, "-o", picture_, "--size", "32x32", "--paint", "distance",
                                    "--reference", truth, "--paint-range", "0,0.5"});
  EXPECT_EQ(distance.code, 0) << distance.err;
  EXPECT_THAT(distance.err, HasSubstr("dark blue 0, turquoise 0.125, yellow-green 0.25"));
  EXPECT_THAT(distance.err, HasSubstr("values lie between 0.25"));
  TriangleMesh with_quality = test::sphere(1, 12);
  with_quality.layout = {{"quality", ScalarType::float32}};
  with_quality.attributes = {std::vector<float>(with_quality.positions.size(), 2.5F)};
  write_mesh(with_quality, mesh_);
  EXPECT_THAT(run_lamina({"render", mesh_, "-o", picture_, "--paint", "quality"}).err,
              HasSubstr("values lie between 2.5 and 2.5"));
  const auto unknown = run_lamina({"render", mesh_, "-o", picture_, "--paint", "mauve"});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("quality"));
  for (const std::vector<std::string>& wrong : {std::vector<std::string>{"--paint", "distance"},
                                                {"--reference", truth},
                                                {"--paint-range", "1,0", "--paint", "quality"},
                                                {"--paint-range", "0,1"},
                                                {"--paint", "quality", "--colour", "none"}}) {
    std::vector<std::string> words{"render", mesh_, "-o", folder_ / "wrong.png"};
    words.insert(words.end(), wrong.begin(), wrong.end());
    EXPECT_EQ(run_lamina(words).code, 2) << wrong[0];
  }
}

TEST_F(RenderTool, PaintsPoints) {
  const std::string truth = folder_ / "truth.ply", cloud = folder_ / "painted.xyz";
  TriangleMesh square;  // z = 0
  square.positions = {{-9, -9, 0}, {9, -9, 0}, {9, 9, 0}, {-9, 9, 0}};
  square.triangles = {{0, 1, 2}, {0, 2, 3}};
  write_mesh(square, truth);
  std::ofstream(cloud) << "x y z nx ny nz radius warmth\n0 0 1 0 0 1 0.5 7\n1 0 3 0 0 1 0.25 9\n0 1 2 0 0 1 0.75 8\n";
  const auto painted = [&](const std::vector<std::string>& what) {
    std::vector<std::string> words{"render", cloud, "-o", picture_, "--size", "32x32", "--paint"};
    words.insert(words.end(), what.begin(), what.end());
    return run_lamina(words);
  };
  EXPECT_THAT(painted({"distance", "--reference", truth}).err, HasSubstr("values lie between 1 and 3"));
  EXPECT_THAT(painted({"radius"}).err, HasSubstr("values lie between 0.25 and 0.75"));
  EXPECT_THAT(painted({"warmth", "--paint-range", "7,9"}).err, HasSubstr("dark blue 7, turquoise 7.5"));
  const auto unknown = painted({"mauve"});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("radius, warmth"));
}

TEST_F(RenderTool, NamesInputThatCannotBeRead) {
  for (const std::string& input : {folder_ / "none.ply", folder_.path()}) {
    const auto outcome = run_lamina({"render", input, "-o", picture_});
    EXPECT_EQ(outcome.code, 3) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(input));
  }
  std::ofstream(cloud_)
      << "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
         "end_header\n";
  EXPECT_EQ(run_lamina({"render", cloud_, "-o", picture_}).code, 5);
  EXPECT_EQ(run_lamina({"render", mesh_, "-o", folder_ / "no/such/out.png"}).code, 4);
}

}  // namespace
}  // namespace lamina::tools
