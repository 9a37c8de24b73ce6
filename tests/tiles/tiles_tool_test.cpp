// Tiles as a user asks for them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "lamina/error.h"
#include "lamina/mesh.h"
#include "lamina/surface.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

class TilesTool : public ::testing::Test {
 protected:
  void SetUp() override { write_points(scan_, sphere_rows(4000), sphere_columns()); }
  void refused(const std::vector<std::string>& arguments, int code, const std::string& word) {
    const long before = folder_.entries();
    const auto outcome = run_lamina(arguments);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(word));
    EXPECT_EQ(folder_.entries(), before);
  }
  const TemporaryFolder folder_;
  const std::string scan_ = folder_ / "scan.ply", mesh_ = folder_ / "mesh.ply", set_ = folder_ / "set";
};

TEST_F(TilesTool, BesideTheMeshOrOfItAreTheSame) {
  const auto outcome = run_lamina({"surface", scan_, "-o", mesh_, "--tiles", set_, "--stats", folder_ / "stats.json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("1 tile in 1 level"));
  const auto stats = nlohmann::json::parse(read_text(folder_ / "stats.json"));
  EXPECT_EQ(stats["tiles"]["triangles"], stats["triangles"]);
  EXPECT_EQ(stats["tiles"]["bytes"], fs::file_size(set_ + "/tiles/0.glb"));
  ASSERT_EQ(run_lamina({"tiles", mesh_, "-o", folder_ / "again"}).code, 0);
  ASSERT_EQ(run_shell("lamina tiles - -o " + quoted(folder_ / "piped") + " < " + quoted(mesh_)).code, 0);
  ASSERT_EQ(run_lamina({"surface", scan_, "-o", folder_ / "m.glb", "--tiles", folder_ / "glb", "-q"}).code, 0);
  for (const char* other : {"again", "piped", "glb"})
    for (const char* file : {"/tileset.json", "/tiles/0.glb"})
      EXPECT_TRUE(read_text(set_ + file) == read_text((folder_ / other) + file)) << other << file;
  ASSERT_EQ(run_lamina({"tiles", mesh_, "-o", folder_ / "plain", "--plain"}).code, 0);
  EXPECT_GT(fs::file_size((folder_ / "plain") + "/tiles/0.glb"), fs::file_size(set_ + "/tiles/0.glb"));
}

// Somebody else puts a file there meanwhile.
TEST_F(TilesTool, AMeshIsThereWithoutItsTiles) {
  SurfaceSettings settings;
  settings.input = scan_;
  settings.output = mesh_;
  settings.tiles.folder = set_;
  RunContext run;
  run.progress = [&](const Progress& p) {
    if (p.stage == "surface")
      write_points((fs::create_directories(set_), set_ + "/other.ply"), sphere_rows(10), sphere_columns());
  };
  try {
    reconstruct_surface(settings, run);
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::budget);
    EXPECT_THAT(error.what(), HasSubstr("set: is there and not empty"));
  }
  EXPECT_GT(read_mesh(mesh_).triangles.size(), 1000U);
  EXPECT_EQ(folder_.entries(), 3);  // the scan, the mesh, the folder
  EXPECT_EQ(std::distance(fs::directory_iterator(set_), fs::directory_iterator()), 1);
}

TEST_F(TilesTool, TellsHowFarItIs) {
  const auto outcome = run_lamina({"surface", scan_, "-o", mesh_, "--tiles", set_});
  EXPECT_THAT(outcome.err, HasSubstr("lamina: tiles  tile 1 of 1  100 %"));
}

TEST_F(TilesTool, Refusals) {
  refused({"tiles", scan_, "-o", set_}, 3, "a point cloud, not a mesh");
  test::write_file(folder_ / "cloud.las", "LASF");
  refused({"tiles", folder_ / "cloud.las", "-o", set_}, 3, "holds points, where a mesh is wanted; 'lamina surface");
  refused({"tiles", folder_ / "nothing.ply", "-o", set_}, 3, "nothing.ply");
  refused({"surface", scan_, "-o", mesh_, "--tiles", mesh_}, 2, "named twice");
  refused({"surface", scan_, "-o", mesh_, "--tiles", folder_ / "no/where"}, 4, "no/where");
  refused({"surface", scan_, "-o", mesh_, "--tiles", folder_.path()}, 4, "not empty");
  refused({"surface", scan_, "-o", mesh_, "--tiles", set_, "--chunk", "1/2"}, 2, "--tiles");
  refused({"surface", scan_, "-o", mesh_, "--tiles", set_, "--checkpoint", folder_ / "parts"}, 2, "--tiles");
}

}  // namespace
}  // namespace lamina::tools
