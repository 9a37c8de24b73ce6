#include "lamina/normals.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

class NormalTool : public ::testing::Test {
 protected:
  static PointColumns bare() {
    PointColumns columns = sphere_columns();
    columns.normals = false;
    return columns;
  }
  /// Share of rows whose normal points away from the origin.
  static double outward(const SampleBatch& rows) {
    std::size_t n = 0;
    for (std::size_t i = 0; i < rows.size(); ++i)
      n += rows.x[i] * rows.nx[i] + rows.y[i] * rows.ny[i] + rows.z[i] * rows.nz[i] > 0.9 ? 1 : 0;
    return static_cast<double>(n) / static_cast<double>(rows.size());
  }

  TemporaryFolder folder_;
  SampleBatch rows_ = sphere_rows(3000, 5);
  std::string cloud_ = write_points(folder_ / "cloud.ply", rows_, bare());
  std::string out_ = folder_ / "out.ply";
};

TEST_F(NormalTool, AddsNormalsAndKeepsEverythingElse) {
  const std::string stats = folder_ / "stats.json";
  const auto run = run_lamina({"normal", cloud_, "-o", out_, "--k", "8", "--stats", stats});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("3000 normals found"));
  const SampleBatch out = read_points(out_);
  EXPECT_EQ(out.x, rows_.x) << "rows keep their order";
  EXPECT_EQ(out.exact, rows_.exact);
  EXPECT_EQ(out.quality, rows_.quality);
  EXPECT_GT(outward(out), 0.999);
  const auto report = nlohmann::json::parse(read_text(stats));
  EXPECT_EQ(report["estimated"], 3000);
  EXPECT_EQ(report["sign_from"]["outside"], 3000);
  EXPECT_EQ(report["sign_conflicts"]["slabs"].size(), 1);
}

TEST_F(NormalTool, WritesOtherFormatsAndReadsPipes) {
  for (const char* ending : {".xyz", ".csv", ".pcd", ".las"}) {
    const std::string out = folder_ / ("out" + std::string(ending));
    ASSERT_EQ(run_lamina({"normal", cloud_, "-o", out, "-q"}).code, 0);
    EXPECT_GT(outward(read_points(out)), 0.999) << ending;
  }
  ASSERT_EQ(run_lamina({"normal", cloud_, "-o", out_, "-q"}).code, 0);
  const auto piped = run_shell("lamina normal - -q -o - < " + test::quoted(cloud_));
  EXPECT_EQ(piped.code, 0) << piped.err;
  EXPECT_EQ(piped.out, read_text(out_));
}

TEST_F(NormalTool, SidesAndSigns) {
  ASSERT_EQ(run_lamina({"normal", cloud_, "-o", out_, "--viewpoint", "0,0,0", "-q"}).code, 0);
  EXPECT_EQ(outward(read_points(out_)), 0);
  const std::string turned = folder_ / "turned.ply";
  const auto run = run_lamina({"normal", out_, "--reorient", "-o", turned});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("3000 turned"));
  EXPECT_GT(outward(read_points(turned)), 0.999);
}

TEST_F(NormalTool, FacesTheScannerOfAPtxFile) {
  std::string ptx = "3000\n1\n0.3 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0.3 0 0 1\n";
  for (std::size_t i = 0; i < rows_.size(); ++i)
    ptx += fmt::format("{} {} {} 0.5\n", rows_.x[i] - 0.3, rows_.y[i], rows_.z[i]);
  const std::string scan = write_file(folder_ / "scan.ptx", ptx);
  ASSERT_EQ(run_lamina({"normal", scan, "-o", out_, "-q"}).code, 0);
  EXPECT_EQ(outward(read_points(out_)), 0);
  ASSERT_EQ(run_lamina({"normal", scan, "-o", out_, "--viewpoint", "none", "-q"}).code, 0);
  EXPECT_GT(outward(read_points(out_)), 0.999);
}

TEST_F(NormalTool, CheckWarnsOfContradictions) {
  SampleBatch rows = rows_;
  for (std::size_t i = 0; i < rows.size(); i += 4) rows.nx[i] *= -1, rows.ny[i] *= -1, rows.nz[i] *= -1;
  write_points(folder_ / "mixed.ply", rows, sphere_columns());
  const auto mixed = run_lamina({"normal", folder_ / "mixed.ply", "--check", "-q"});
  EXPECT_EQ(mixed.code, 0);
  EXPECT_THAT(mixed.err, HasSubstr("point to opposite sides"));
  write_points(folder_ / "good.ply", rows_, sphere_columns());
  EXPECT_EQ(run_lamina({"normal", folder_ / "good.ply", "--check", "-q"}).err, "");
}

TEST_F(NormalTool, RefusalsSayWhatToDo) {
  EXPECT_THAT(run_lamina({"normal", cloud_, "--check"}).err, HasSubstr("no normals to check"));
  EXPECT_THAT(run_lamina({"normal", cloud_, "-o", out_, "--viewpoint", "here"}).err, HasSubstr("X,Y,Z"));
  EXPECT_THAT(run_lamina({"normal", cloud_, "-o", out_, "--reorient", "--missing"}).err, HasSubstr("exclude"));
  EXPECT_EQ(run_lamina({"normal", cloud_}).code, 2);
  const auto refused = run_lamina({"surface", cloud_, "-o", out_, "--normals", "file"});
  EXPECT_EQ(refused.code, 3);
  EXPECT_THAT(refused.err, HasSubstr("--normals auto"));
}

TEST_F(NormalTool, SurfaceFindsTheNormalsItLacks) {
  const std::string stats = folder_ / "stats.json";
  const std::string mesh = folder_ / "mesh.ply";
  const auto run = run_lamina({"surface", cloud_, "-o", mesh, "--stats", stats});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_GT(nlohmann::json::parse(read_text(stats))["normals"]["estimated"], 2999);
  const TriangleMesh surface = read_mesh(mesh);
  double volume = 0;
  for (const auto& t : surface.triangles) {
    const auto &a = surface.positions[t[0]], &b = surface.positions[t[1]], &c = surface.positions[t[2]];
    volume +=
        (a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])) /
        6;
  }
  EXPECT_NEAR(volume, 4.19, 0.1);

  // Half of them not a number: those are found, the others stay.
  SampleBatch rows = rows_;
  for (std::size_t i = 0; i < rows.size(); i += 2) rows.nx[i] = rows.ny[i] = rows.nz[i] = 0;
  const std::string half = write_points(folder_ / "half.ply", rows, sphere_columns());
  ASSERT_EQ(run_lamina({"surface", half, "-o", mesh, "--normals", "auto", "--stats", stats, "-q"}).code, 0);
  EXPECT_EQ(nlohmann::json::parse(read_text(stats))["normals"]["estimated"], 1500);
  EXPECT_EQ(nlohmann::json::parse(read_text(stats))["samples_used"], 3000);
  // All there: nothing to find.
  const std::string full = write_points(folder_ / "full.ply", rows_, sphere_columns());
  ASSERT_EQ(run_lamina({"surface", full, "-o", mesh, "--normals", "auto", "--stats", stats, "-q"}).code, 0);
  EXPECT_FALSE(nlohmann::json::parse(read_text(stats)).contains("normals"));
}

}  // namespace
}  // namespace lamina::tools
