#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "lamina/info.h"
#include "lamina/measure.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

class ConvertTool : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  SampleBatch rows_ = sphere_rows(400, 8);
  std::string cloud_ = write_points(folder_ / "cloud.ply", rows_, sphere_columns());
  std::string mesh_ = sphere_mesh(folder_ / "mesh.ply", 1, 24);
  std::string out_ = folder_ / "out.ply";
};

TEST_F(ConvertTool, PointsStayWhatTheyAre) {
  ASSERT_EQ(run_lamina({"convert", cloud_, "-o", out_}).code, 0);
  EXPECT_EQ(row_texts(read_points(out_)), row_texts(rows_));
  ASSERT_EQ(run_lamina({"convert", cloud_, "--precision", "float", "-o", out_}).code, 0);
  EXPECT_FALSE(open_points(out_)->info().double_precision);
  EXPECT_EQ(read_points(out_).x[3], static_cast<double>(static_cast<float>(rows_.x[3])));
  const auto piped = run_shell("cat " + test::quoted(cloud_) + " | lamina convert stdin.ply -o stdout.ply --quiet");
  ASSERT_EQ(run_lamina({"convert", cloud_, "-o", out_}).code, 0);
  EXPECT_TRUE(piped.out == read_text(out_)) << piped.err;
}

TEST_F(ConvertTool, MeshesChangeTheirFormat) {
  const std::string obj = folder_ / "mesh.obj";
  ASSERT_EQ(run_lamina({"convert", mesh_, "-o", obj}).code, 0);
  EXPECT_EQ(read_mesh(obj).triangles, read_mesh(mesh_).triangles);
  ASSERT_EQ(run_lamina({"convert", mesh_, "--vertices", "-o", out_}).code, 0);
  EXPECT_EQ(content_of(out_), FileContent::points);
  EXPECT_EQ(read_points(out_).size(), read_mesh(mesh_).positions.size());
}

TEST_F(ConvertTool, VerticesThatAreNotFiniteAreLeftOutOfMeshes) {
  TriangleMesh mesh = read_mesh(mesh_);
  const std::size_t vertices = mesh.positions.size();
  mesh.positions[3][1] = std::nan("");
  const std::string bad = folder_ / "bad.ply";
  write_mesh(mesh, bad);
  const auto refused = run_lamina({"compare", bad, mesh_});
  EXPECT_EQ(refused.code, 3);
  EXPECT_THAT(refused.err, HasSubstr("'lamina convert " + bad + " -o mesh.ply' leaves it out"));
  const auto converted = run_lamina({"convert", bad, "-o", out_});
  EXPECT_EQ(converted.code, 0);
  EXPECT_THAT(converted.err, HasSubstr("1 vertex is not finite and left out"));
  EXPECT_EQ(read_mesh(out_).positions.size(), vertices - 1);
  EXPECT_EQ(run_lamina({"convert", bad, "--bad-samples", "refuse", "-o", out_}).code, 3);
}

TEST_F(ConvertTool, AMeshComesBackFromItsLevelSet) {
  const std::string volume = folder_ / "mesh.vdb", fog = folder_ / "fog.vdb";
  ASSERT_EQ(run_lamina({"convert", mesh_, "--voxelsize", "0.05", "-o", volume}).code, 0);
  ASSERT_EQ(run_lamina({"convert", volume, "-o", out_}).code, 0);
  const TriangleMesh back = read_mesh(out_);
  EXPECT_NEAR(*measure_mesh(back).volume, *measure_mesh(read_mesh(mesh_)).volume, 0.02);
  for (const auto& p : back.positions) {
    const double radius = std::hypot(p[0], p[1], p[2]);
    EXPECT_GT(radius, 0.98);
    EXPECT_LT(radius, 1.005);
  }
  ASSERT_EQ(run_lamina({"convert", volume, "--fog", "-o", fog}).code, 0);
  EXPECT_THAT(run_lamina({"info", fog}).out, HasSubstr("grid 'density'"));
  EXPECT_EQ(run_lamina({"convert", volume, "-o", fog}).code, 2) << "a volume already";
}

TEST_F(ConvertTool, PointsComeBackFromTheirGrid) {
  const std::string volume = folder_ / "points.vdb";
  PointColumns columns = sphere_columns();
  columns.double_positions = false;
  columns.attributes.pop_back();
  rows_.attributes.pop_back();
  rows_.exact.clear();
  write_points(cloud_, rows_, columns);
  ASSERT_EQ(run_lamina({"convert", cloud_, "-o", volume}).code, 0);
  ASSERT_EQ(run_lamina({"convert", volume, "-o", out_}).code, 0);
  const auto as_set = [](const SampleBatch& rows) {
    std::vector<std::array<double, 3>> places;
    for (std::size_t i = 0; i < rows.size(); ++i) places.push_back({rows.x[i], rows.y[i], rows.z[i]});
    std::sort(places.begin(), places.end());
    return places;
  };
  EXPECT_EQ(as_set(read_points(out_)), as_set(read_points(cloud_)));
}

TEST_F(ConvertTool, AnswersMistakesWithTheirCodes) {
  EXPECT_EQ(run_lamina({"convert", cloud_, "-o", folder_ / "a.stl"}).code, 2);
  EXPECT_EQ(run_lamina({"convert", cloud_, "-o", folder_ / "a.what"}).code, 2);
  EXPECT_EQ(run_lamina({"convert", mesh_, "-o", folder_ / "a.what"}).code, 2);
  EXPECT_EQ(run_lamina({"convert", mesh_, "--fog", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"convert", folder_ / "none.ply", "-o", out_}).code, 3);
  EXPECT_EQ(run_lamina({"convert", write_file(folder_ / "bad.vdb", "not a volume"), "-o", out_}).code, 3);
  EXPECT_EQ(run_lamina({"convert", cloud_, "-o", folder_ / "no/such.ply"}).code, 4);
}

}  // namespace
}  // namespace lamina::tools
