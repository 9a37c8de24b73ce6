#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "lamina/mesh.h"
#include "render/shapes.h"
#include "support/program.h"

namespace lamina::tools {
namespace {

using test::run_lamina;
using ::testing::HasSubstr;

class VolumeTool : public ::testing::Test {
 protected:
  VolumeTool() { write_mesh(test::sphere(1, 12), mesh_); }
  test::TemporaryFolder folder_;
  std::string mesh_ = folder_ / "sphere.obj", volume_ = folder_ / "out.vdb";
};

TEST_F(VolumeTool, ConvertsAndReports) {
  const auto outcome = run_lamina({"volume", mesh_, "-o", volume_, "--voxel", "0.1"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("voxels of 0.1, signed"));
  const auto piped = run_lamina({"volume", mesh_, "-o", "-", "--voxel", "0.1", "--quiet"});
  EXPECT_EQ(piped.err, "");
  EXPECT_TRUE(piped.out == test::read_text(volume_));
}

TEST_F(VolumeTool, SaysWhenTheMeshIsOpen) {
  write_mesh(test::square(1, 0, {1, 2, 3}), mesh_);
  EXPECT_THAT(run_lamina({"volume", mesh_, "-o", volume_}).err, HasSubstr("without a sign"));
}

TEST_F(VolumeTool, AnswersMistakesWithTheirCodes) {
  EXPECT_EQ(run_lamina({"volume", mesh_, "-o", volume_, "--voxel", "-1"}).code, 2);
  EXPECT_EQ(run_lamina({"volume", mesh_, "-o", volume_, "--sign", "maybe"}).code, 2);
  EXPECT_EQ(run_lamina({"volume", mesh_}).code, 2);
  EXPECT_EQ(run_lamina({"volume", mesh_, "-o", mesh_}).code, 2) << "a volume called mesh";
  EXPECT_EQ(run_lamina({"volume", folder_ / "none.obj", "-o", volume_}).code, 3);
  EXPECT_EQ(run_lamina({"volume", mesh_, "-o", folder_ / "no/such.vdb"}).code, 4);
  EXPECT_FALSE(std::filesystem::exists(volume_));
}

}  // namespace
}  // namespace lamina::tools
