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
