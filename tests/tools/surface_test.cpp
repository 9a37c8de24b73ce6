// The program `lamina surface` as a user meets it.
#include "lamina/surface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "lamina/mesh.h"
#include "lamina/points.h"
#include "reconstruct/clouds.h"
#include "support/program.h"

namespace lamina::tools {
namespace {

using test::quoted;
using test::run_lamina;
using test::run_shell;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class SurfaceTool : public ::testing::Test {
 protected:
  SurfaceTool() { std::filesystem::create_directory(tmp_); }
  test::Outcome run(std::vector<std::string> options) const {
    options.insert(options.begin(), {"surface", cloud_, "-o", mesh_});
    return run_lamina(options);
  }
  /// Exit code, one line that holds every word, and nothing left but the input.
  void expect_failure(const test::Outcome& outcome, int code, const std::vector<std::string>& words) const {
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    for (const std::string& word : words) EXPECT_THAT(outcome.err, HasSubstr(word));
    expect_nothing_left();
  }
  void expect_nothing_left() const {
    EXPECT_EQ(folder_.entries(), 2);  // the input and the folder for temporary files
    EXPECT_TRUE(std::filesystem::is_empty(tmp_));
  }

  test::TemporaryFolder folder_;
  const std::string cloud_ = test::write_cloud(test::sphere_cloud(4000), folder_ / "cloud.ply");
  const std::string mesh_ = folder_ / "mesh.ply", tmp_ = folder_ / "tmp", stats_ = folder_ / "stats.json";
};

// Without an option cells are finer, and triangles go where that is flat: fewer of them, within a thousandth.
TEST_F(SurfaceTool, WhereItIsFlatTrianglesGo) {
  test::write_cloud(test::sphere_cloud(20'000), cloud_);
  const auto made = [this](const std::vector<std::string>& options) {
    EXPECT_EQ(run(options).code, 0);
    TriangleMesh mesh = read_mesh(mesh_);
    EXPECT_TRUE(test::check_mesh(mesh.triangles).is_closed_manifold());
    return mesh;
  };
  const TriangleMesh thinned = made({"--stats", stats_}), all = made({"--deviation", "0"});
  const auto stats = nlohmann::json::parse(test::read_file(stats_));
  EXPECT_EQ(stats.at("triangles"), thinned.triangles.size());
  EXPECT_GT(stats.at("simplified").at("triangles_before"), all.triangles.size());
  EXPECT_LT(thinned.triangles.size(), 0.8 * static_cast<double>(all.triangles.size()));
  EXPECT_LT(test::deviation(thinned, test::distance_to_sphere).largest, 2e-3);
  made({"--raw", "--stats", stats_});
  EXPECT_EQ(nlohmann::json::parse(test::read_file(stats_)).at("deviation"), 0);
}

TEST_F(SurfaceTool, MakesAMeshAndSaysSo) {
  const auto outcome = run({});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.out, "");
  const TriangleMesh mesh = read_mesh(mesh_);
  EXPECT_TRUE(test::check_mesh(mesh.triangles).is_closed_manifold());
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("samples 4000"), HasSubstr("levels 4"), HasSubstr("influence R = 1 r"),
                                 HasSubstr("slabs"), HasSubstr("expected memory"), HasSubstr("temporary disk")));
  EXPECT_THAT(outcome.err, HasSubstr(std::to_string(mesh.positions.size()) + " vertices, " +
                                     std::to_string(mesh.triangles.size()) + " triangles"));
  EXPECT_EQ(folder_.entries(), 3);
}

TEST_F(SurfaceTool, TheEndingSaysTheFormat) {
  ASSERT_EQ(run({"--quiet"}).code, 0);
  const TriangleMesh ply = read_mesh(mesh_);
  for (const std::string name : {"mesh.obj", "mesh.off", "mesh.STL", "mesh.glb"}) {
    const std::string path = folder_ / name;
    const auto outcome = run_lamina({"surface", cloud_, "-o", path, "--quiet"});
    EXPECT_EQ(outcome.code, 0);
    EXPECT_EQ(outcome.err, "");
    const TriangleMesh mesh = read_mesh(path);
    EXPECT_EQ(mesh.positions.size(), ply.positions.size()) << name;  // STL's are welded by position
    ASSERT_EQ(mesh.triangles.size(), ply.triangles.size()) << name;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k)
        ASSERT_EQ(mesh.positions[mesh.triangles[t][k]], ply.positions[ply.triangles[t][k]]) << name;
    }
    std::filesystem::remove(path);
  }
  std::filesystem::remove(mesh_);
  for (const char* name : {"mesh.gltf", "mesh.ply.gz", "mesh.obj.gz"}) {
    expect_failure(run_lamina({"surface", cloud_, "-o", folder_ / name}), 2, {name, "PLY, OBJ, OFF, STL or GLB"});
  }
  expect_failure(run_lamina({"surface", cloud_, "-o", folder_ / "no/such/mesh.obj"}), 4, {"does not exist"});
}

TEST_F(SurfaceTool, SeveralOutputsAreOneMesh) {
  ASSERT_EQ(run({"--quiet"}).code, 0);
  const std::string ply = test::read_text(mesh_), glb = folder_ / "m.glb", stl = folder_ / "m.stl";
  std::filesystem::remove(mesh_);
  const auto outcome = run_lamina({"surface", cloud_, "-o", glb, "-o", mesh_, "-o", stl, "-o", folder_ / "more.ply",
                                   "--quiet", "--tmp-dir", tmp_, "--preview", folder_ / "m.png"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(folder_.entries(), 7);
  EXPECT_TRUE(std::filesystem::is_empty(tmp_));
  EXPECT_TRUE(test::read_text(mesh_) == ply);
  EXPECT_TRUE(test::read_text(folder_ / "more.ply") == ply);
  const TriangleMesh mesh = read_mesh(mesh_), other = read_mesh(glb);
  EXPECT_EQ(other.positions, mesh.positions);
  EXPECT_EQ(other.triangles, mesh.triangles);
  EXPECT_EQ(read_mesh(stl).triangles.size(), mesh.triangles.size());
  // Standard output is one of them.
  const auto piped = run_shell("lamina surface " + quoted(cloud_) + " -q -o " + quoted(folder_ / "p.glb") +
                               " -o - | cmp - " + quoted(mesh_));
  EXPECT_EQ(piped.code, 0) << piped.out << piped.err;
  EXPECT_TRUE(test::read_text(folder_ / "p.glb") == test::read_text(glb));
}

TEST_F(SurfaceTool, SeveralOutputsThatCannotBeMeant) {
  expect_failure(run({"-o", mesh_}), 2, {"mesh.ply", "named twice"});
  expect_failure(run({"-o", cloud_}), 2, {"cloud.ply", "input and output"});
  expect_failure(run({"-o", folder_ / "mesh.gltf"}), 2, {"mesh.gltf", "GLB"});
  expect_failure(run({"-o", folder_ / "no/mesh.glb"}), 4, {"mesh.glb", "does not exist"});
  expect_failure(run({"-o", folder_ / "b.glb", "--chunk", "1/2"}), 2, {"--chunk"});
}

TEST_F(SurfaceTool, ProgressIsPlainLinesOffATerminal) {
  const auto outcome = run({});
  EXPECT_EQ(outcome.err.find('\r'), std::string::npos);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("lamina: survey  4.00 k of 4.00 k samples"), HasSubstr("lamina: read"),
                                 HasSubstr("lamina: surface"), HasSubstr("slab ")));
}

TEST_F(SurfaceTool, QuietSaysNothingButWarnings) {
  EXPECT_EQ(run({"--quiet"}).err, "");
  auto cloud = test::sphere_cloud(4000);
  cloud.positions[3][0] = std::nan("");
  test::write_cloud(cloud, cloud_);
  EXPECT_EQ(run({"-q"}).err, "lamina: warning: " + cloud_ +
                                 ": 1 of 4000 samples have a non-finite position, the first is row 3 (counted from 0); "
                                 "dropped\n");
}

TEST_F(SurfaceTool, ADryRunPrintsThePlanAndWritesNothing) {
  for (const char* quiet : {"--quiet", "--threads=1"}) {
    const auto outcome = run({"--dry-run", quiet});
    EXPECT_EQ(outcome.code, 0);
    EXPECT_THAT(outcome.out, AllOf(HasSubstr("samples 4000"), HasSubstr("levels 4"), HasSubstr("slabs "),
                                   HasSubstr("expected memory "), HasSubstr("temporary disk ")));
    expect_nothing_left();
  }
  // Neither does it need an output.
  EXPECT_EQ(run_lamina({"surface", cloud_, "--dry-run", "--tmp-dir", tmp_}).code, 0);
  EXPECT_EQ(run_lamina({"surface", cloud_}).code, 2);
}

TEST_F(SurfaceTool, APreviewShowsTheMeshOrItsVertices) {
  const std::string picture = folder_ / "preview.png";
  const auto whole = run({"--preview", picture});
  EXPECT_EQ(whole.code, 0) << whole.err;
  EXPECT_THAT(whole.err, AllOf(HasSubstr(picture), HasSubstr("triangles")));
  EXPECT_EQ(test::read_file(picture).substr(1, 3), "PNG");
  const auto refused = run_lamina({"surface", cloud_, "-o", "-", "--preview", picture});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("--preview"));
  const auto before = std::filesystem::last_write_time(mesh_);
  for (const auto& [path, code] : {std::pair{folder_ / "no/such/picture.png", 4}, std::pair{mesh_, 2}})
    EXPECT_EQ(run({"--preview", path}).code, code) << path;
  EXPECT_EQ(std::filesystem::last_write_time(mesh_), before) << "known before the work began";
}

TEST_F(SurfaceTool, PipesOnBothEnds) {
  ASSERT_EQ(run({"--quiet"}).code, 0);
  const std::string mesh = test::read_file(mesh_);
  for (const char* names : {"- -o -", "stdin.ply -o stdout.ply", "- --output=stdout.ply"}) {
    const auto outcome = run_shell("cd " + quoted(tmp_) + " && cat " + quoted(cloud_) +
                                   " 2>/dev/null | lamina surface --quiet " + names + " | cat");
    EXPECT_TRUE(outcome.out == mesh) << names;
    EXPECT_EQ(outcome.err, "");
    EXPECT_TRUE(std::filesystem::is_empty(tmp_));
  }
  EXPECT_TRUE(run_shell("lamina surface - -o - -q <" + quoted(cloud_)).out == mesh);  // a file, not a pipe
  EXPECT_EQ(run_shell("head -c 1000 " + quoted(cloud_) + " 2>/dev/null | lamina surface - -o -").code, 3);
}

TEST_F(SurfaceTool, AClosedPipeIsAWriteError) {
  const auto outcome = run_shell("{ lamina surface " + quoted(cloud_) + " -q -o -; echo code $? >&2; } | true");
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("standard output: cannot be written"), HasSubstr("code 4")));
  expect_nothing_left();
}

TEST_F(SurfaceTool, StatsTellEverything) {
  auto cloud = test::sphere_cloud(4000);
  cloud.positions[3][0] = std::nan("");
  cloud.positions[4][1] = std::numeric_limits<double>::infinity();
  cloud.normals[100] = {0, 0, 0};
  cloud.add_property("radius", ScalarType::float32, [](const test::Point3&) { return 0.13; });
  cloud.values[0][11] = 0;
  cloud.values[0][12] = -1;
  cloud.values[0][13] = 5;  // above --max-radius
  cloud.add_property("quality", ScalarType::float32, [](const test::Point3&) { return 1.0; });
  cloud.values[1][20] = -1;
  test::write_cloud(cloud, cloud_);
  const auto outcome = run({"--stats", stats_, "--max-radius", "0.2"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto j = nlohmann::json::parse(test::read_file(stats_));
  const TriangleMesh mesh = read_mesh(mesh_);
  EXPECT_EQ(j["samples"], 4000);
  EXPECT_EQ(j["samples_used"], 3994);
  EXPECT_EQ(j["vertices"], mesh.positions.size());
  EXPECT_EQ(j["triangles"], mesh.triangles.size());
  EXPECT_EQ(j["levels"], 4);
  EXPECT_EQ(j["leaf_cells_by_level"].size(), 4u);
  EXPECT_GT(j["wall_seconds"], 0);
  EXPECT_GT(j["cpu_seconds"], 0);
  EXPECT_GE(j["threads"], 1);
  EXPECT_LE(j["partly_idle_seconds"], j["wall_seconds"]);
  EXPECT_GT(j["peak_memory_bytes"], 1 << 20);
  EXPECT_GT(j["expected_memory_bytes"], 1 << 20);
  EXPECT_GE(j["temporary_disk_bytes"], 13 * mesh.triangles.size());
  double wall = 0;
  std::set<std::string> stages;
  for (const auto& stage : j["stages"]) {
    stages.insert(stage["stage"]);
    EXPECT_GE(stage["wall"], 0);
    EXPECT_GE(stage["cpu"], 0);
    EXPECT_LE(stage["partly_idle"], stage["wall"]);
    if (stage["stage"] != "mark") wall += stage["wall"].get<double>();  // part of another
  }
  EXPECT_LE(wall, j["wall_seconds"].get<double>() * 1.0001);
  EXPECT_GT(wall, 0.5 * j["wall_seconds"].get<double>());
  for (const char* stage : {"survey", "store", "radii", "refine", "project", "triangulate", "commit"}) {
    EXPECT_TRUE(stages.contains(stage)) << stage;
  }
  const auto expected = nlohmann::json::parse(R"([
    {"reason": "non-finite position", "count": 2, "first_row": 3},
    {"reason": "zero or non-finite normal", "count": 1, "first_row": 100},
    {"reason": "radius not positive", "count": 2, "first_row": 11},
    {"reason": "quality negative or non-finite", "count": 1, "first_row": 20},
    {"reason": "radius above --max-radius", "count": 1}])");
  EXPECT_EQ(j["rejected"], expected);
  for (const auto& reason : expected) EXPECT_THAT(outcome.err, HasSubstr(reason["reason"].get<std::string>()));
  EXPECT_GT(j["clusters"]["collapsed"], 0);
  EXPECT_EQ(j["dry_run"], false);
  EXPECT_EQ(folder_.entries(), 4);
}

TEST_F(SurfaceTool, StatsOfADryRunAndToStandardOutput) {
  const auto outcome = run({"--dry-run", "--stats", "-", "--quiet"});
  const auto j = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(j["dry_run"], true);
  EXPECT_EQ(j["samples"], 4000);
  EXPECT_EQ(j["triangles"], 0);
  expect_nothing_left();
}

TEST_F(SurfaceTool, StatsThatCannotBeWrittenAreKnownBeforeTheWork) {
  expect_failure(run({"--stats", folder_ / "no/such.json"}), 4, {"no/such.json", "No such file"});
  expect_failure(run({"--stats", tmp_}), 4, {tmp_, "directory"});
  expect_failure(run_lamina({"surface", cloud_, "-o", "-", "--stats", "-"}), 2, {"--stats", "--output"});
  // A run that fails leaves older statistics as they were.
  test::write_file(stats_, "old");
  EXPECT_EQ(run_lamina({"surface", folder_ / "none.ply", "-o", mesh_, "--stats", stats_}).code, 3);
  EXPECT_EQ(test::read_file(stats_), "old");
}

TEST_F(SurfaceTool, WordsAndNumbersThatCannotBeMeant) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong{
      {{"--fit", "cubic"}, "--fit"},
      {{"--cluster", "some"}, "--cluster"},
      {{"--frame", "x"}, "--frame"},
      {{"--bad-samples", "keep"}, "--bad-samples"},
      {{"--cell", "wide"}, "--cell"},
      {{"--cell", "0"}, "--cell"},
      {{"--max-radius", "-1"}, "--max-radius"},
      {{"--blend", "0"}, "--blend"},
      {{"--steps", "0"}, "--steps"},
      {{"--levels", "13"}, "--levels"},
      {{"--window", "0"}, "--window"},
      {{"--threads", "-1"}, "--threads"},
      {{"--max-memory", "much"}, "--max-memory"},
      {{"--density", "1"}, "--density"},
      {{"--tmp-dir", folder_ / "none"}, "--tmp-dir"},
      {{"--blnd", "2"}, "did you mean '--blend'"},
      {{"--columns", "x,y"}, "--columns"}};
  for (const auto& [options, word] : wrong) expect_failure(run(options), 2, {word});
}

TEST_F(SurfaceTool, SeveralInputsAreOneCloud) {
  // Two halves of the sphere, one as text and turned, give the mesh of the whole.
  ASSERT_EQ(run({"--quiet"}).code, 0);
  const std::string whole = test::read_file(mesh_);
  const auto source = open_points(cloud_);
  SampleBatch batch;
  source->read(0, 4000, batch);
  std::string first;
  std::string second;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    // x y z becomes y -x z: a quarter turn, undone by the pose.
    const bool turned = i >= 1234;
    (turned ? second : first) +=
        fmt::format("{} {} {} {} {} {}\n", turned ? batch.y[i] : batch.x[i], turned ? -batch.x[i] : batch.y[i],
                    batch.z[i], turned ? batch.ny[i] : batch.nx[i], turned ? -batch.nx[i] : batch.ny[i], batch.nz[i]);
  }
  test::write_file(tmp_ + "/a.xyz", first);
  test::write_file(tmp_ + "/b.xyz", second);
  test::write_file(tmp_ + "/b.txt", "0 -1 0 0\n1 0 0 0\n0 0 1 0\n0 0 0 1\n");
  const auto outcome = run_lamina({"surface", tmp_ + "/a.xyz", tmp_ + "/b.xyz@" + tmp_ + "/b.txt", "-o", mesh_});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("columns taken as x,y,z,nx,ny,nz"));
  EXPECT_TRUE(test::read_file(mesh_) == whole);
  EXPECT_EQ(run_lamina({"surface", tmp_ + "/a.xyz", "-q", "-o", tmp_ + "/a.xyz"}).code, 2);
}

TEST_F(SurfaceTool, BadInputExitsAsDocumented) {
  expect_failure(run_lamina({"surface", folder_ / "none.ply", "-o", mesh_}), 3, {"none.ply"});
  expect_failure(run_lamina({"surface", tmp_, "-o", mesh_}), 3, {tmp_, "no point files"});
  expect_failure(run_lamina({"surface", "-", "-o", mesh_}), 3, {"standard input", "empty"});
  expect_failure(run_lamina({"surface", cloud_, "-o", folder_ / "no/mesh.ply"}), 4, {"no/mesh.ply", "does not exist"});
  expect_failure(run_lamina({"surface", cloud_, "-o", tmp_}), 4, {tmp_, "directory"});
  expect_failure(run_lamina({"surface", cloud_, "-o", cloud_}), 2, {cloud_, "input and output"});
  expect_failure(run_lamina({"surface", cloud_, "-o", folder_ / "mesh.ply.gz"}), 2, {"mesh.ply.gz", "| gzip"});
  expect_failure(run_lamina({"surface", cloud_, "-o", folder_ / "mesh.vdb"}), 2, {"mesh.vdb", "--vdb"});
  expect_failure(run({"--max-memory", "1M", "--quiet"}), 4, {cloud_, "--max-memory allows 1 MB"});
  expect_failure(run_shell("lamina surface " + quoted(cloud_) + " -q -o - >/dev/full"), 4,
                 {"standard output", "No space left"});
  test::write_file(cloud_, test::read_file(cloud_).substr(0, 5000));
  expect_failure(run({"--quiet"}), 3, {cloud_});
}

// A limit on file sizes stands for a full disk: every file that grows meets it.
TEST_F(SurfaceTool, NoRoomForTemporaryFilesOrTheOutput) {
  auto cloud = test::sphere_cloud(60000);
  cloud.add_property("intensity", ScalarType::float32, [](const test::Point3& p) { return p[0]; });
  test::write_cloud(cloud, cloud_);
  const std::string job = "lamina surface " + quoted(cloud_) + " -q -o " + quoted(mesh_) + " --tmp-dir " + quoted(tmp_);
  // In units of 512 bytes: the store of the samples, and the vertices or the faces.
  expect_failure(run_shell("ulimit -f 100; " + job), 4, {tmp_, "File too large", "--tmp-dir"});
  expect_failure(run_shell("ulimit -f 2600; " + job + " --cluster none"), 4, {"File too large"});
  expect_failure(run_shell("ulimit -f 100; cat " + quoted(cloud_) + " 2>/dev/null | lamina surface - -q -o " +
                           quoted(mesh_) + " --tmp-dir " + quoted(tmp_)),
                 4, {tmp_, "standard input", "File too large"});
}

TEST_F(SurfaceTool, ASignalCancelsAndCleansUp) {
  test::write_cloud(test::sphere_cloud(400000), cloud_);
  for (const char* signal : {"INT", "TERM"}) {
    const auto outcome =
        run_shell(quoted(LAMINA_PROGRAM) + " surface " + quoted(cloud_) + " -o " + quoted(mesh_) + " --tmp-dir " +
                  quoted(tmp_) + " --cell 0.3R --threads 1 & job=$!; sleep 0.6; kill -" + signal + " $job; wait $job");
    EXPECT_EQ(outcome.code, 1) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("lamina: cancelled"));
    expect_nothing_left();
  }
}

TEST_F(SurfaceTool, HelpListsTheOptionsInGroups) {
  const auto outcome = run_lamina({"surface", "--help"});
  EXPECT_EQ(outcome.code, 0);
  for (const char* word :
       {"Samples",         "Fit",       "Octree",       "Mesh",      "Run",         "--frame",  "--bad-samples",
        "--particlescale", "--density", "--max-radius", "--blend",   "--steps",     "--fit",    "--diffuse",
        "--cell",          "--levels",  "--boundary",   "--cluster", "--chord",     "--window", "--dry-run",
        "--stats",         "--threads", "--quiet",      "--tmp-dir", "--max-memory"}) {
    EXPECT_THAT(outcome.out, HasSubstr(word));
  }
}

}  // namespace
}  // namespace lamina::tools
