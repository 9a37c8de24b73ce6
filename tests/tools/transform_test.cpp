#include "lamina/edit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "lamina/measure.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;

class TransformTool : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  SampleBatch rows_ = sphere_rows(500, 3, 0.25);
  std::string cloud_ = write_points(folder_ / "cloud.ply", rows_, sphere_columns());
  std::string out_ = folder_ / "out.ply", back_ = folder_ / "back.ply";
};

TEST_F(TransformTool, MovesTurnsAndScalesInThatOrder) {
  ASSERT_EQ(
      run_lamina({"transform", cloud_, "--scale", "2", "--rotate", "90,0,0", "--translate", "10,20,30", "-o", out_})
          .code,
      0);
  const SampleBatch moved = read_points(out_);
  for (std::size_t i = 0; i < moved.size(); ++i) {
    // A quarter turn about x takes y to z and z to -y, exactly.
    EXPECT_DOUBLE_EQ(moved.x[i], 2 * rows_.x[i] + 10);
    EXPECT_DOUBLE_EQ(moved.y[i], -2 * rows_.z[i] + 20);
    EXPECT_DOUBLE_EQ(moved.z[i], 2 * rows_.y[i] + 30);
    EXPECT_NEAR(moved.nx[i], rows_.nx[i], 1e-6);
    EXPECT_NEAR(moved.ny[i], -rows_.nz[i], 1e-6);
    EXPECT_NEAR(moved.nz[i], rows_.ny[i], 1e-6);
  }
  EXPECT_EQ(moved.attributes, rows_.attributes);
  EXPECT_EQ(moved.exact, rows_.exact);
}

TEST_F(TransformTool, InvertUndoesAnyOfThem) {
  const std::vector<std::string> how{"--scale",     "2,0.5,-3", "--rotate", "20,-50,170",
                                     "--translate", "5,-6,7",   "--pivot",  "1,2,3"};
  std::vector<std::string> there{"transform", cloud_, "-o", out_}, again{"transform", out_, "--invert", "-o", back_};
  there.insert(there.end(), how.begin(), how.end());
  again.insert(again.end(), how.begin(), how.end());
  ASSERT_EQ(run_lamina(there).code, 0);
  ASSERT_EQ(run_lamina(again).code, 0);
  const SampleBatch same = read_points(back_);
  for (std::size_t i = 0; i < same.size(); ++i) {
    EXPECT_NEAR(same.x[i], rows_.x[i], 1e-12);
    EXPECT_NEAR(same.z[i], rows_.z[i], 1e-12);
    EXPECT_NEAR(same.ny[i], rows_.ny[i], 1e-6);
  }
}

TEST_F(TransformTool, AMatrixIsReadRowByRow) {
  ASSERT_EQ(run_lamina({"transform", cloud_, "--matrix", "0,0,1,7,1,0,0,8,0,1,0,9,0,0,0,1", "-o", out_}).code, 0);
  const SampleBatch moved = read_points(out_);
  EXPECT_DOUBLE_EQ(moved.x[9], rows_.z[9] + 7);
  EXPECT_DOUBLE_EQ(moved.y[9], rows_.x[9] + 8);
  EXPECT_DOUBLE_EQ(moved.z[9], rows_.y[9] + 9);
}

TEST_F(TransformTool, FloatsBecomeDoublesWhereTheyWouldLoseDetail) {
  PointColumns columns = sphere_columns();
  columns.double_positions = false;
  write_points(cloud_, rows_, columns);
  ASSERT_EQ(run_lamina({"transform", cloud_, "--translate", "1,2,3", "-o", out_}).code, 0);
  EXPECT_FALSE(open_points(out_)->info().double_precision);
  ASSERT_EQ(run_lamina({"transform", cloud_, "--translate", "500000,5800000,0", "-o", out_}).code, 0);
  EXPECT_TRUE(open_points(out_)->info().double_precision);
  EXPECT_NEAR(read_points(out_).y[4], rows_.y[4] + 5800000, 1e-6);
}

TEST_F(TransformTool, NormalsStayAtRightAnglesAndRadiiFollowTheVolume) {
  SampleBatch rows;
  rows.x = rows.y = rows.z = {0};
  rows.nx = {3};  // a normal of length 5 on the plane 3 x + 4 y = 0
  rows.ny = {4};
  rows.nz = {0};
  rows.radius = {1};
  transform_rows(rows, make_transform({.scale = {2, 4, 1}}));
  // The plane's direction (4, -3, 0) becomes (8, -12, 0).
  EXPECT_NEAR(rows.nx[0] * 8 - rows.ny[0] * 12, 0, 1e-5);
  EXPECT_NEAR(std::hypot(rows.nx[0], rows.ny[0], rows.nz[0]), 5, 1e-5);
  EXPECT_NEAR(rows.radius[0], 2, 1e-6);
}

TEST_F(TransformTool, AMirroredMeshKeepsItsOutsideOutside) {
  const std::string mesh = sphere_mesh(folder_ / "mesh.ply");
  ASSERT_EQ(run_lamina({"transform", mesh, "--scale", "-1,2,1", "-o", out_}).code, 0);
  EXPECT_NEAR(*measure_mesh(read_mesh(out_)).volume, 2 * *measure_mesh(read_mesh(mesh)).volume, 1e-9);
}

TEST_F(TransformTool, AnswersMistakesWithTheirCodes) {
  EXPECT_EQ(run_lamina({"transform", cloud_, "--scale", "0", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"transform", cloud_, "--scale", "1,2", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"transform", cloud_, "--matrix", "1,0,0,0,0,1,0,0,0,0,1,0,5,6,7,1", "-o", out_}).code, 2)
      << "the translation in the last row";
  EXPECT_EQ(
      run_lamina({"transform", cloud_, "--scale", "2", "--matrix", "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1", "-o", out_}).code,
      2);
  EXPECT_EQ(run_lamina({"transform", folder_ / "none.ply", "-o", out_}).code, 3);
}

}  // namespace
}  // namespace lamina::tools
