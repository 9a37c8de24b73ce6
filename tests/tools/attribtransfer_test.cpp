#include "lamina/edit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

double distance(const SampleBatch& rows, std::size_t i, const std::array<double, 3>& p) {
  return std::hypot(rows.x[i] - p[0], rows.y[i] - p[1], rows.z[i] - p[2]);
}

class AttribTransferTool : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  SampleBatch rows_ = sphere_rows(1500, 4);
  std::string cloud_ = write_points(folder_ / "cloud.ply", rows_, sphere_columns());
  std::string mesh_ = sphere_mesh(folder_ / "mesh.ply", 0.9);
  std::string out_ = folder_ / "out.ply";

  [[nodiscard]] std::size_t nearest(const std::array<double, 3>& p) const {
    std::size_t best = 0;
    for (std::size_t i = 1; i < rows_.size(); ++i)
      if (distance(rows_, i, p) < distance(rows_, best, p)) best = i;
    return best;
  }
};

TEST_F(AttribTransferTool, GivesTheNearestPointsValues) {
  ASSERT_EQ(run_lamina({"attribtransfer", mesh_, cloud_, "--attributes", "red,blue", "-o", out_}).code, 0);
  const TriangleMesh mesh = read_mesh(out_);
  EXPECT_EQ(mesh.layout, (AttributeLayout{{"red", ScalarType::uint8}, {"blue", ScalarType::uint8}}));
  EXPECT_EQ(mesh.triangles, read_mesh(mesh_).triangles);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const std::size_t i = nearest(mesh.positions[v]);
    EXPECT_EQ(mesh.attributes[0][v], rows_.attributes[0][i]) << v;
    EXPECT_EQ(mesh.attributes[1][v], rows_.attributes[2][i]) << v;
  }
}

TEST_F(AttribTransferTool, PortionsGiveTheSameAsAllAtOnce) {
  TriangleMesh whole = read_mesh(mesh_), parts = whole;
  for (const TransferMode mode : {TransferMode::nearest, TransferMode::weighted}) {
    const auto source = open_points(cloud_);
    TransferSettings settings{mode, {}, 0.3};
    transfer_attributes(*source, whole, settings);
    settings.points_at_once = 100;
    transfer_attributes(*source, parts, settings);
    for (std::size_t a = 0; a < whole.attributes.size(); ++a)
      for (std::size_t v = 0; v < whole.positions.size(); ++v)
        EXPECT_NEAR(parts.attributes[a][v], whole.attributes[a][v], 1e-5 * whole.attributes[a][v]);
  }
}

TEST_F(AttribTransferTool, WeighsThePointsInReach) {
  ASSERT_EQ(run_lamina({"attribtransfer", mesh_, cloud_, "--mode", "weighted", "--distance", "0.35", "--attributes",
                        "green", "-o", out_})
                .code,
            0);
  const TriangleMesh mesh = read_mesh(out_);
  for (std::size_t v = 0; v < mesh.positions.size(); v += 7) {
    double sum = 0, weights = 0;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const double t = 1 - std::pow(distance(rows_, i, mesh.positions[v]) / 0.35, 2);
      if (t <= 0) continue;
      weights += std::pow(t, 4);
      sum += std::pow(t, 4) * static_cast<double>(rows_.attributes[1][i]);
    }
    ASSERT_GT(weights, 0);
    EXPECT_NEAR(mesh.attributes[0][v], sum / weights, 0.501) << "rounded to a byte";
  }
}

TEST_F(AttribTransferTool, TellsWhichVerticesNoPointReaches) {
  const auto outcome = run_lamina({"attribtransfer", mesh_, cloud_, "--distance", "0.11", "-o", out_});
  ASSERT_EQ(outcome.code, 0);
  const TriangleMesh mesh = read_mesh(out_);
  std::size_t far = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const std::size_t i = nearest(mesh.positions[v]);
    const bool reached = distance(rows_, i, mesh.positions[v]) <= 0.11;
    far += reached ? 0 : 1;
    EXPECT_EQ(mesh.attributes[0][v], reached ? rows_.attributes[0][i] : 0);
  }
  EXPECT_GT(far, 0U);
  EXPECT_THAT(outcome.err, HasSubstr(std::to_string(far) + " of " + std::to_string(mesh.positions.size()) +
                                     " vertices have no point near enough"));
}

TEST_F(AttribTransferTool, AnswersMistakesWithTheirCodes) {
  const auto unknown = run_lamina({"attribtransfer", mesh_, cloud_, "--attributes", "rde", "-o", out_});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("they have red, green, blue, id"));
  const auto no_radii = run_lamina({"attribtransfer", mesh_, cloud_, "--mode", "weighted", "-o", out_});
  EXPECT_EQ(no_radii.code, 2);
  EXPECT_THAT(no_radii.err, HasSubstr("lamina radius"));
  EXPECT_EQ(run_lamina({"attribtransfer", mesh_, folder_ / "none.ply", "-o", out_}).code, 3);
  EXPECT_EQ(run_lamina({"attribtransfer", mesh_, cloud_, "-o", folder_ / "no/such.ply"}).code, 4);
}

}  // namespace
}  // namespace lamina::tools
