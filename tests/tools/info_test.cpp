#include "lamina/info.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using nlohmann::json;
using ::testing::HasSubstr;

class InfoTool : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  SampleBatch rows_ = sphere_rows(700, 6, 500000);
  std::string cloud_ = write_points(folder_ / "cloud.ply", rows_, sphere_columns());
};

TEST_F(InfoTool, TellsRangesThatAreTrue) {
  const json info = json::parse(run_lamina({"info", cloud_, "--json"}).out);
  EXPECT_EQ(info["content"], "points");
  EXPECT_EQ(info["points"], 700);
  std::map<std::string, json> columns;
  for (const json& column : info["attributes"]) columns[column["name"]] = column;
  EXPECT_EQ(columns.size(), 11U);
  const auto expect_range = [&](const std::string& name, const auto& values, const char* type) {
    const json& column = columns[name];
    double sum = 0;
    for (const auto v : values) sum += static_cast<double>(v);
    EXPECT_EQ(column["low"].get<double>(), static_cast<double>(*std::min_element(values.begin(), values.end())))
        << name;
    EXPECT_EQ(column["high"].get<double>(), static_cast<double>(*std::max_element(values.begin(), values.end())))
        << name;
    EXPECT_NEAR(column["mean"].get<double>(), sum / 700, 1e-6) << name;
    EXPECT_EQ(column["type"], type);
  };
  expect_range("x", rows_.x, "double");
  expect_range("nz", rows_.nz, "float");
  expect_range("confidence", rows_.quality, "float");
  expect_range("red", rows_.attributes[0], "uint8");
  expect_range("id", rows_.exact[3], "uint32");
}

TEST_F(InfoTool, CountsRadiiBySize) {
  SampleBatch rows;
  for (int i = 0; i < 64; ++i) rows.radius.push_back(i < 48 ? 1.1F : 3.0F);
  rows.x.assign(64, 0);
  rows.y = rows.z = rows.x;
  PointColumns columns;
  columns.radius = "pscale";
  write_points(cloud_, rows, columns);
  const json radii = json::parse(run_lamina({"info", cloud_, "--json"}).out)["radii"];
  ASSERT_EQ(radii.size(), 4U) << "from 1 to 4 by half octaves";
  EXPECT_EQ(radii[0]["count"], 48);
  EXPECT_EQ(radii[0]["low"], 1);
  EXPECT_EQ(radii[3]["count"], 16);
  EXPECT_EQ(radii[1]["count"].get<int>() + radii[2]["count"].get<int>(), 0);
  EXPECT_THAT(run_lamina({"info", cloud_}).out, HasSubstr("pscale"));
}

TEST_F(InfoTool, KnowsMeshesAndPipes) {
  const std::string mesh = sphere_mesh(folder_ / "mesh.ply", 3);
  for (const std::string& line : std::vector<std::string>{"lamina info --json " + test::quoted(mesh),
                                                          "cat " + test::quoted(mesh) + " | lamina info - --json"}) {
    const auto outcome = run_shell(line);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const json info = json::parse(outcome.out);
    EXPECT_EQ(info["content"], "mesh");
    EXPECT_EQ(info["triangles"], read_mesh(mesh).triangles.size());
    EXPECT_EQ(info["high"][2], 3);
  }
  EXPECT_THAT(run_shell("cat " + test::quoted(cloud_) + " | lamina info -").out, HasSubstr("700 points"));
}

TEST_F(InfoTool, KnowsVolumes) {
  const std::string volume = folder_ / "sphere.vdb";
  ASSERT_EQ(run_lamina({"convert", sphere_mesh(folder_ / "mesh.ply"), "-o", volume, "--voxelsize", "0.1"}).code, 0);
  const auto outcome = run_lamina({"info", volume, "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json grid = json::parse(outcome.out)["grids"][0];
  EXPECT_EQ(grid["name"], "surface");
  EXPECT_EQ(grid["class"], "level set");
  EXPECT_NEAR(grid["voxel"][0].get<double>(), 0.1, 1e-12);
  EXPECT_THAT(run_lamina({"info", volume}).out, HasSubstr("grid 'surface'"));
}

TEST_F(InfoTool, TellsContentByContent) {
  EXPECT_EQ(content_of(cloud_), FileContent::points);
  EXPECT_EQ(content_of(sphere_mesh(folder_ / "mesh.obj")), FileContent::mesh);
  EXPECT_EQ(content_of(write_file(folder_ / "vertices.obj", "v 1 2 3\nv 4 5 6\n")), FileContent::points);
  EXPECT_EQ(content_of(write_file(folder_ / "a.xyz", "1 2 3\n")), FileContent::points);
  EXPECT_EQ(content_of(write_file(folder_ / "none.ply",
                                  "ply\r\nformat ascii 1.0\r\nelement vertex 1\r\nelement face 0\r\nend_header\r\n")),
            FileContent::points);
}

TEST_F(InfoTool, AnswersMistakesWithTheirCodes) {
  EXPECT_EQ(run_lamina({"info", folder_ / "none.ply"}).code, 3);
  EXPECT_EQ(run_lamina({"info", write_file(folder_ / "cut.ply", read_text(cloud_).substr(0, 900))}).code, 3);
  EXPECT_EQ(run_lamina({"info", write_file(folder_ / "empty.ply", "")}).code, 3);
  EXPECT_EQ(run_lamina({"info"}).code, 2);
}

}  // namespace
}  // namespace lamina::tools
