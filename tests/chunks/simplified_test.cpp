// A mesh simplified behind its reconstruction is the same whichever way it was made.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "chunks/chunked.h"
#include "lamina/error.h"
#include "lamina/measure.h"
#include "lamina/mesh.h"
#include "lamina/mesh_receiver.h"
#include "lamina/simplify.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

Cloud coloured_pipe() {
  std::mt19937 random(11);
  std::uniform_real_distribution<> uniform;
  Cloud cloud;
  while (cloud.size() < 12'000) {
    const double z = 4 * uniform(random), a = 2 * std::numbers::pi * uniform(random), r = 0.3 + 0.1 * std::sin(3 * z);
    cloud.add({r * std::cos(a), r * std::sin(a), z}, {std::cos(a), std::sin(a), -0.3 * std::cos(3 * z)});
  }
  cloud.add_property("red", ScalarType::uint8, [](const Point3& p) { return std::floor(127 + 200 * p[0]); });
  return cloud;
}

/// Joins the pieces.
class Joined final : public MeshReceiver {
 public:
  void begin(const StreamedMeshLayout&) override {}
  void take(TriangleMesh piece) override {
    positions += piece.positions.size();
    triangles += piece.triangles.size();
  }
  std::size_t positions = 0, triangles = 0;
};

class SimplifiedSurface : public ::testing::Test {
 protected:
  void SetUp() override {
    settings_.input = test::write_cloud(coloured_pipe(), folder_ / "in.ply");
    settings_.simplify.triangles = 3000;
  }
  test::TemporaryFolder folder_;
  SurfaceSettings settings_;
};

TEST_F(SimplifiedSurface, IsTheSameForThreadsWindowsChunksAndCheckpoints) {
  const std::string whole = test::whole_bytes(settings_, folder_);
  const TriangleMesh mesh = read_mesh(folder_ / "whole.ply");
  EXPECT_LE(mesh.triangles.size(), 3000U);
  EXPECT_GE(mesh.triangles.size(), 2990U);
  EXPECT_TRUE(check_mesh(mesh).manifold());
  SurfaceSettings other = settings_;
  other.output = folder_ / "other.ply";
  other.window = 3;
  for (const int threads : {1, 2, 5}) {
    RunContext run;
    run.threads = threads;
    reconstruct_surface(other, run);
    EXPECT_TRUE(test::read_file(other.output) == whole) << threads;
  }
  reconstruct_resumable(other, {folder_ / "checkpoint", false}, {});
  EXPECT_TRUE(test::read_file(other.output) == whole);
  SurfaceSettings of_parts = settings_;
  of_parts.simplify = {};
  write_store(of_parts, folder_ / "in.store", {});
  const std::vector<std::string> parts = test::make_parts(of_parts, folder_ / "in.store", 3, folder_);
  merge_parts(parts, {folder_ / "merged.ply"}, {}, settings_.simplify);
  EXPECT_TRUE(test::read_file(folder_ / "merged.ply") == whole);
  EXPECT_THROW(test::make_parts(settings_, folder_ / "in.store", 2, folder_), Error);
}

TEST_F(SimplifiedSurface, SaysWhatItDid) {
  settings_.output = folder_ / "mesh.ply";
  settings_.more_outputs = {folder_ / "mesh.off"};
  settings_.tiles.folder = folder_ / "tiles";
  const SurfaceStats stats = reconstruct_surface(settings_, {});
  EXPECT_GT(stats.simplified.triangles_before, 10'000U);
  EXPECT_EQ(stats.simplified.triangles_after, stats.triangles);
  EXPECT_TRUE(stats.simplified.reached);
  EXPECT_GT(stats.simplified.deviation, 0);
  EXPECT_EQ(stats.tiles.triangles, stats.triangles);
  const TriangleMesh ply = read_mesh(settings_.output), off = read_mesh(settings_.more_outputs[0]);
  EXPECT_EQ(ply.triangles, off.triangles);
  EXPECT_EQ(ply.positions.size(), stats.vertices);
  SurfaceSettings handed = settings_;
  handed.output.clear();
  handed.more_outputs.clear();
  handed.tiles.folder.clear();
  const auto joined = std::make_shared<Joined>();
  handed.receiver = joined;
  reconstruct_surface(handed, {});
  EXPECT_EQ(joined->triangles, ply.triangles.size());
  EXPECT_EQ(joined->positions, ply.positions.size());
}

TEST_F(SimplifiedSurface, AsManyAsThereAreStay) {
  settings_.simplify = {};
  const std::string full = test::whole_bytes(settings_, folder_);
  settings_.simplify.triangles = 10'000'000;
  std::string said;
  RunContext run;
  run.log = [&](LogLevel level, std::string_view text) {
    if (level == LogLevel::warning) said += text;
  };
  settings_.output = folder_ / "all.ply";
  const SurfaceStats stats = reconstruct_surface(settings_, run);
  EXPECT_EQ(stats.simplified.triangles_before, stats.simplified.triangles_after);
  EXPECT_NE(said.find("stays as it is"), std::string::npos) << said;
  EXPECT_TRUE(test::read_file(settings_.output) == full);
}

TEST_F(SimplifiedSurface, RefusesGoalsBeforeAnythingIsRead) {
  settings_.output = folder_ / "mesh.ply";
  settings_.input = folder_ / "not_there.ply";
  for (const SimplifySettings& goal : {SimplifySettings{.triangles = 5, .error = 1}, SimplifySettings{.error = -1},
                                       SimplifySettings{.error = std::nan("")}, SimplifySettings{.ratio = 2}}) {
    settings_.simplify = goal;
    try {
      reconstruct_surface(settings_, {});
      ADD_FAILURE();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::usage) << error.what();
    }
  }
  EXPECT_FALSE(std::filesystem::exists(settings_.output));
}

}  // namespace
}  // namespace lamina
