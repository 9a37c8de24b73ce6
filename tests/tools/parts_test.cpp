// lamina sort --store, surface --chunk, --print-tasks, --checkpoint, and merge of parts, as a queue runs them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

class PartsTool : public ::testing::Test {
 protected:
  PartsTool() {
    EXPECT_EQ(run_lamina({"sort", cloud_, "--store", store_, "--quiet"}).code, 0);
    EXPECT_EQ(run_lamina({"surface", cloud_, "-o", whole_, "--steps", "2", "--quiet"}).code, 0);
  }
  TemporaryFolder folder_;
  std::string cloud_ = write_points(folder_ / "cloud.ply", sphere_rows(3000, 5), sphere_columns());
  std::string store_ = folder_ / "a store", whole_ = folder_ / "whole.ply", mesh_ = folder_ / "a mesh.ply";
};

TEST_F(PartsTool, PrintedTasksMakeTheSameMesh) {
  const Outcome tasks = run_lamina({"surface", store_, "-o", mesh_, "--steps", "2", "--quiet", "--print-tasks", "3"});
  ASSERT_EQ(tasks.code, 0) << tasks.err;
  EXPECT_EQ(std::count(tasks.out.begin(), tasks.out.end(), '\n'), 4);
  const Outcome outcome = run_shell("set -e\n" + tasks.out);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(read_text(mesh_) == read_text(whole_));
}

TEST_F(PartsTool, MeshesOfEveryFormat) {
  std::vector<std::string> merge{"merge"};
  for (const char* chunk : {"1/2", "2/2"}) {
    merge.push_back(folder_ / (std::string(1, chunk[0]) + ".lmesh"));
    ASSERT_EQ(run_lamina({"surface", store_, "--steps", "2", "--chunk", chunk, "-o", merge.back()}).code, 0);
  }
  for (const std::string ending : {".obj", ".off", ".stl", ".glb"}) {
    const std::string whole = folder_ / ("of_one_run" + ending), merged = folder_ / ("of_parts" + ending);
    ASSERT_EQ(run_lamina({"surface", cloud_, "-o", whole, "--steps", "2"}).code, 0);
    std::vector<std::string> words = merge;
    words.insert(words.end(), {"-o", merged});
    const Outcome outcome = run_lamina(words);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    if (ending != ".glb") {
      EXPECT_THAT(outcome.err, HasSubstr(ending == ".stl" ? "not the properties red, green, blue, id;"
                                                          : "no place for the properties id;"));
    }
    EXPECT_TRUE(read_text(merged) == read_text(whole)) << ending;
    const std::string resumed = folder_ / ("resumed" + ending);
    EXPECT_EQ(run_lamina({"surface", cloud_, "-o", resumed, "--steps", "2", "--checkpoint", folder_ / "kept"}).code, 0);
    EXPECT_TRUE(read_text(resumed) == read_text(whole)) << ending;
  }
  // Several at once, merged and resumed.
  std::vector<std::string> words = merge;
  words.insert(words.end(), {"-o", folder_ / "both.glb", "-o", mesh_});
  EXPECT_EQ(run_lamina(words).code, 0);
  EXPECT_EQ(run_lamina({"surface", cloud_, "-o", folder_ / "again.ply", "-o", folder_ / "again.glb", "--steps", "2",
                        "--checkpoint", folder_ / "kept"})
                .code,
            0);
  for (const char* glb : {"both.glb", "again.glb"})
    EXPECT_TRUE(read_text(folder_ / glb) == read_text(folder_ / "of_one_run.glb")) << glb;
  EXPECT_TRUE(read_text(mesh_) == read_text(folder_ / "again.ply"));
}

TEST_F(PartsTool, TasksAsJsonSayWhatComesAfterWhat) {
  const Outcome tasks = run_lamina({"surface", store_, "-o", mesh_, "--diffuse", "--print-tasks", "2", "--json"});
  ASSERT_EQ(tasks.code, 0) << tasks.err;
  const auto list = nlohmann::json::parse(tasks.out).at("tasks");
  ASSERT_EQ(list.size(), 3u);
  EXPECT_EQ(list[0].at("command"),
            nlohmann::json({"lamina", "surface", store_, "--diffuse", "--chunk", "1/2", "-o", list[0].at("output")}));
  EXPECT_EQ(list[2].at("after"), nlohmann::json({list[0].at("name"), list[1].at("name")}));
  EXPECT_EQ(list[2].at("output"), mesh_);
}

TEST_F(PartsTool, AMissingPartIsNamed) {
  const std::string part = folder_ / "two.lmesh";
  ASSERT_EQ(run_lamina({"surface", store_, "--chunk", "2/2", "-o", part}).code, 0);
  EXPECT_EQ(run_lamina({"merge", part, "-o", folder_ / "mesh.gltf"}).code, 2);
  const Outcome outcome = run_lamina({"merge", part, "-o", mesh_});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("chunk 1 of 2 is missing"));
  EXPECT_FALSE(std::filesystem::exists(mesh_));
}

TEST_F(PartsTool, OptionsThatCannotBeMeant) {
  EXPECT_EQ(run_lamina({"surface", store_, "--chunk", "2", "-o", mesh_}).code, 2);
  EXPECT_EQ(run_lamina({"surface", store_, "--chunk", "3/2", "-o", mesh_}).code, 2);
  EXPECT_EQ(run_lamina({"surface", cloud_, "--chunk", "1/2", "-o", mesh_}).code, 2);
  EXPECT_EQ(run_lamina({"surface", cloud_, "--resume", "-o", mesh_}).code, 2);
  EXPECT_EQ(run_lamina({"surface", store_, "--json", "-o", mesh_}).code, 2);
  EXPECT_EQ(run_lamina({"sort", cloud_}).code, 2);
  EXPECT_EQ(run_lamina({"sort", cloud_, "--store", folder_ / "b", "-o", mesh_}).code, 2);
  EXPECT_EQ(run_lamina({"sort", cloud_, cloud_, "-o", mesh_}).code, 2);
}

TEST_F(PartsTool, AStoreIsCleanedAndGetsItsNormalsWhileItIsMade) {
  const std::string bare = folder_ / "bare.xyz", store = folder_ / "ready";
  PointColumns columns = sphere_columns();
  columns.normals = false;
  write_points(bare, sphere_rows(3000, 5), columns);
  const std::vector<std::string> reading{"--merge", "0", "--outliers", "5", "--normals", "auto", "--k", "8"};
  const auto with = [&](std::vector<std::string> words) {
    words.insert(words.end(), reading.begin(), reading.end());
    return run_lamina(words);
  };
  ASSERT_EQ(with({"surface", bare, "-o", whole_}).code, 0);
  const Outcome sorted = with({"sort", bare, "--store", store});
  ASSERT_EQ(sorted.code, 0) << sorted.err;
  ASSERT_EQ(run_lamina({"surface", store, "-o", mesh_}).code, 0);
  EXPECT_TRUE(read_text(mesh_) == read_text(whole_));
  EXPECT_EQ(run_lamina({"sort", bare, "--outliers", "5", "-o", mesh_}).code, 2);
}

TEST_F(PartsTool, Checkpoint) {
  const std::string folder = folder_ / "checkpoint";
  const Outcome outcome = run_lamina({"surface", cloud_, "-o", mesh_, "--steps", "2", "--checkpoint", folder});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(read_text(mesh_) == read_text(whole_));
  EXPECT_FALSE(std::filesystem::exists(folder));
}

}  // namespace
}  // namespace lamina::tools
