#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

TEST(MeasureTool, PrintsATableOrJson) {
  const TemporaryFolder folder;
  TriangleMesh tetrahedron;
  tetrahedron.positions = {{0, 0, 0}, {6, 0, 0}, {0, 6, 0}, {0, 0, 6}};
  tetrahedron.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  write_mesh(tetrahedron, folder / "mesh.ply");
  const auto table = run_lamina({"measure", folder / "mesh.ply"});
  EXPECT_EQ(table.code, 0) << table.err;
  EXPECT_THAT(table.out, HasSubstr("36"));
  const auto piped = run_shell("cat " + test::quoted(folder / "mesh.ply") + " | lamina measure - --json");
  EXPECT_NEAR(nlohmann::json::parse(piped.out)["volume"].get<double>(), 36, 1e-9) << piped.err;
}

TEST(MeasureTool, AnswersMistakesWithTheirCodes) {
  const TemporaryFolder folder;
  write_points(folder / "points.ply", sphere_rows(10), sphere_columns());
  EXPECT_EQ(run_lamina({"measure", folder / "points.ply"}).code, 3);
  EXPECT_EQ(run_lamina({"measure", folder / "none.ply"}).code, 3);
  EXPECT_EQ(run_lamina({"measure"}).code, 2);
}

}  // namespace
}  // namespace lamina::tools
