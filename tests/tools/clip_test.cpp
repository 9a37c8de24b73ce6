#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

class ClipTool : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string cloud_ = write_points(folder_ / "cloud.ply", sphere_rows(2000), sphere_columns());
  std::string mesh_ = sphere_mesh(folder_ / "mesh.ply");
  std::string out_ = folder_ / "out.ply";
};

TEST_F(ClipTool, KeepsTheRowsThatBruteForceKeeps) {
  const SampleBatch all = read_points(cloud_);
  const auto texts = row_texts(all);
  const auto inside = [&](std::size_t i) {
    return all.x[i] >= -0.5 && all.x[i] <= 0.7 && all.y[i] >= -1 && all.y[i] <= 0.25 && all.z[i] >= -2 &&
           all.z[i] <= 0.9 && 0.5 * all.x[i] + (all.z[i] + 0.5) >= 0;
  };
  for (const std::string keep : {"inside", "outside"}) {
    std::vector<std::string> expected;
    for (std::size_t i = 0; i < texts.size(); ++i)
      if (inside(i) == (keep == "inside")) expected.push_back(texts[i]);
    const auto outcome = run_lamina({"clip", cloud_, "--box", "-0.5,-1,-2,0.7,0.25,0.9", "--plane", "0,0,-0.5,0.5,0,1",
                                     "--keep", keep, "-o", out_});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(row_texts(read_points(out_)), expected) << keep;
    EXPECT_GT(expected.size(), 100U);
  }
}

TEST_F(ClipTool, StreamsThroughPipes) {
  ASSERT_EQ(run_lamina({"clip", cloud_, "--plane", "0,0,0,1,0,0", "-o", out_}).code, 0);
  const auto piped = run_shell("cat " + test::quoted(cloud_) + " | lamina clip - --plane 0,0,0,1,0,0 -o - --quiet");
  EXPECT_EQ(piped.code, 0) << piped.err;
  EXPECT_TRUE(piped.out == read_text(out_));
  const auto meshes = run_shell("cat " + test::quoted(mesh_) +
                                " | lamina clip - --plane 0,0,0,1,0,0 -o - --quiet | lamina check - --expect manifold");
  EXPECT_EQ(meshes.code, 0) << meshes.err;
}

TEST_F(ClipTool, AnswersMistakesWithTheirCodes) {
  EXPECT_EQ(run_lamina({"clip", cloud_, "-o", out_}).code, 2) << "no region";
  EXPECT_EQ(run_lamina({"clip", cloud_, "--box", "1,2,3", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"clip", cloud_, "--box", "1,0,0,0,1,1", "-o", out_}).code, 2) << "empty box";
  EXPECT_EQ(run_lamina({"clip", cloud_, "--plane", "0,0,0,0,0,0", "-o", out_}).code, 2) << "no normal";
  EXPECT_EQ(run_lamina({"clip", folder_ / "none.ply", "--plane", "0,0,0,0,0,1", "-o", out_}).code, 3);
  EXPECT_EQ(run_lamina({"clip", cloud_, "--plane", "0,0,0,0,0,1", "-o", folder_ / "no/such.ply"}).code, 4);
  const auto nothing = run_lamina({"clip", cloud_, "--plane", "0,0,5,0,0,1", "-o", out_});
  EXPECT_EQ(nothing.code, 5);
  EXPECT_THAT(nothing.err, HasSubstr("nothing of it lies inside"));
  EXPECT_EQ(run_lamina({"clip", mesh_, "--plane", "0,0,5,0,0,1", "-o", out_}).code, 5);
}

}  // namespace
}  // namespace lamina::tools
