// Any number of ranks writes the mesh that one process writes, byte for byte.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "ranks/launched.h"
#include "reconstruct/clouds.h"
#include "reconstruct/constants.h"
#include "support/program.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

/// A crooked pipe along an oblique axis, 64 times as dense in places as in others, with colours and quality.
Cloud pipe(std::size_t count) {
  std::mt19937 random(5);
  std::uniform_real_distribution<> uniform;
  Cloud cloud;
  while (cloud.size() < count) {
    const double t = 5 * uniform(random), a = 2 * std::numbers::pi * uniform(random);
    if (uniform(random) > std::exp2(-3 * (1 + std::sin(2 * t)))) continue;
    const double r = 0.3 + 0.05 * std::sin(4 * t);
    cloud.add({r * std::cos(a) + t, r * std::sin(a), 0.4 * t}, {std::cos(a), std::sin(a), 0});
  }
  cloud.add_property("red", ScalarType::uint8, [](const Point3& p) { return std::floor(120 + 100 * p[1]); });
  cloud.add_property("confidence", ScalarType::float32, [](const Point3& p) { return 1.5 + p[1]; });
  return cloud;
}

class RankIdentity : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const std::string reason = test::no_ranks(); !reason.empty()) GTEST_SKIP() << reason;
  }
  void expect_same(const std::vector<std::string>& arguments, const std::vector<int>& counts) {
    std::vector<std::string> words{"surface"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    // Ranks share out an input's rows and write no whole mesh: they leave out neither strays nor specks.
    words.insert(words.end(), {"--keep-strays", "--prune", "0", "-o", folder_ / "whole.ply", "-q"});
    const test::Outcome alone = test::run_lamina(words);
    ASSERT_EQ(alone.code, 0) << alone.err;
    const std::string whole = test::read_file(folder_ / "whole.ply");
    ASSERT_GT(whole.size(), 10000u);
    words[words.size() - 2] = folder_ / "ranks.ply";
    const long entries = folder_.entries();
    for (const int ranks : counts) {
      const test::Outcome outcome = test::run_ranks(ranks, words);
      ASSERT_EQ(outcome.code, 0) << ranks << " ranks: " << outcome.err;
      EXPECT_TRUE(test::read_file(folder_ / "ranks.ply") == whole) << ranks << " ranks";
      std::filesystem::remove(folder_ / "ranks.ply");
      EXPECT_EQ(folder_.entries(), entries) << "something is left behind by " << ranks << " ranks";
    }
  }
  test::TemporaryFolder folder_;
};

TEST_F(RankIdentity, DemoScan) {
  expect_same({LAMINA_SOURCE_DIR "/data/amphora_scan.ply", "--cell", "0.02", "--threads", "1"}, {2, 3});
}

TEST_F(RankIdentity, VaryingDensity) {
  expect_same({test::write_cloud(pipe(12000), folder_ / "in.ply"), "--threads", "1"}, {1, 2, 5});
}

TEST_F(RankIdentity, SimplifiedMesh) {
  expect_same({test::write_cloud(pipe(6000), folder_ / "in.ply"), "--triangles", "3000", "--threads", "1"}, {3});
}

TEST_F(RankIdentity, InputThatIsReadInOrder) {
  expect_same({test::write_cloud(pipe(6000), folder_ / "in.ply", PlyFormat::ascii), "--threads", "2"}, {3});
}

TEST_F(RankIdentity, SeveralFilesAndStoredSamples) {
  const std::string one = test::write_cloud(pipe(4000), folder_ / "one.ply");
  const std::string two = test::write_cloud(pipe(7000), folder_ / "two.ply");
  expect_same({one, two, "--max-radius", "3r"}, {3});
  ASSERT_EQ(test::run_lamina({"sort", one, two, "--store", folder_ / "store", "-q"}).code, 0);
  expect_same({folder_ / "store"}, {2});
}

TEST_F(RankIdentity, SeveralOutputs) {
  const std::string in = test::write_cloud(pipe(6000), folder_ / "in.ply");
  const auto words = [&](const std::string& name) {
    return std::vector<std::string>{"surface",
                                    in,
                                    "--keep-strays",
                                    "--prune",
                                    "0",
                                    "-o",
                                    folder_ / (name + ".glb"),
                                    "-o",
                                    folder_ / (name + ".ply"),
                                    "-q"};
  };
  ASSERT_EQ(test::run_lamina(words("alone")).code, 0);
  const test::Outcome outcome = test::run_ranks(2, words("ranks"));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  for (const std::string ending : {".glb", ".ply"})
    EXPECT_TRUE(test::read_file(folder_ / ("ranks" + ending)) == test::read_file(folder_ / ("alone" + ending)));
  EXPECT_EQ(folder_.entries(), 5);
}

TEST_F(RankIdentity, HolesAcrossTheBordersOfRanks) {
  Cloud cloud = pipe(12000);
  Cloud pierced;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Point3& p = cloud.positions[i];
    if (std::hypot(std::fmod(p[0] + 8, 0.6) - 0.3, p[1]) > 0.12) pierced.add(p, cloud.normals[i]);
  }
  expect_same({test::write_cloud(pierced, folder_ / "in.ply"), "--close-holes", "40", "--curvature"}, {2, 5});
}

TEST_F(RankIdentity, ChosenByTheNoise) {
  Cloud cloud = pipe(8000);
  std::mt19937 random(19);
  std::uniform_real_distribution<> uniform(-0.03, 0.03);
  for (Point3& p : cloud.positions) {
    for (double& c : p) c += uniform(random);
  }
  expect_same({test::write_cloud(cloud, folder_ / "in.ply"), "--blend", "auto", "--threads", "1", "--stats",
               folder_ / "s.json"},
              {2});
  const auto range = nlohmann::json::parse(test::read_file(folder_ / "s.json")).at("blend_range");
  EXPECT_LT(range[0], range[1]) << "by place";
}

TEST_F(RankIdentity, MoreRanksThanSlabs) {
  expect_same({test::write_cloud(test::sphere_cloud(1500), folder_ / "in.ply"), "--threads", "1"}, {9});
}

TEST_F(RankIdentity, StatsTellWhatEachRankDid) {
  const std::string in = test::write_cloud(pipe(8000), folder_ / "in.ply");
  const test::Outcome outcome = test::run_ranks(
      3, {"surface", in, "-o", folder_ / "out.ply", "--deviation", "0", "--stats", folder_ / "stats.json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto stats = nlohmann::json::parse(test::read_file(folder_ / "stats.json"));
  ASSERT_EQ(stats.at("ranks").size(), 3u);
  std::uint64_t rows = 0, vertices = 0, triangles = 0;
  std::int64_t next = 0;
  for (const auto& rank : stats.at("ranks")) {
    rows += rank.at("rows_read").get<std::uint64_t>();
    vertices += rank.at("vertices").get<std::uint64_t>();
    triangles += rank.at("triangles").get<std::uint64_t>();
    EXPECT_EQ(rank.at("first_slab").get<std::int64_t>(), next);
    next += rank.at("slabs").get<std::int64_t>();
    EXPECT_GE(rank.at("samples_held"), rank.at("samples").get<std::uint64_t>() * 9 / 10);
    EXPECT_GT(rank.at("sent_bytes"), 0);
    EXPECT_GT(rank.at("peak_memory_bytes"), 1 << 20);
    EXPECT_LE(rank.at("waited_seconds"), rank.at("wall_seconds"));
  }
  EXPECT_EQ(rows, 8000u);
  // What closes holes is of no rank. What leaves triangles out behind all of them, neither.
  EXPECT_EQ(vertices + stats.at("holes").at("added_vertices").get<std::uint64_t>(), stats.at("vertices"));
  EXPECT_EQ(triangles + stats.at("holes").at("added_triangles").get<std::uint64_t>(), stats.at("triangles"));
  EXPECT_NE(outcome.err.find("rank 2: read"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace lamina
