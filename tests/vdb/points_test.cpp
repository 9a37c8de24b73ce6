#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <bit>
#include <map>
#include <numeric>
#include <random>

#include "lamina/error.h"
#include "lamina/volume_points.h"
#include "lamina/volume_tools.h"
#include "support/program.h"
#include "vdb/grids.h"

namespace lamina {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Every array a row has, as bits, so that clouds compare as sets.
using Row = std::vector<std::uint64_t>;

std::vector<Row> rows(const PointArrays& p) {
  const SampleBatch& s = p.samples;
  std::vector<std::size_t> order(p.layout.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return p.layout[a].name < p.layout[b].name; });
  std::vector<Row> out(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) {
    for (const auto* a : {&s.x, &s.y, &s.z}) out[i].push_back(std::bit_cast<std::uint64_t>((*a)[i] + 0.0));
    const auto put = [&](const std::vector<float>& a) {
      if (!a.empty()) out[i].push_back(std::bit_cast<std::uint32_t>(a[i] + 0.0F));
    };
    for (const auto* a : {&s.nx, &s.ny, &s.nz, &s.radius, &s.quality}) put(*a);
    for (const std::size_t a : order) put(s.attributes[a]);
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// Floats of any size in the positions, and every kind of attribute.
PointArrays random_points(std::size_t count, unsigned seed, double size = 3) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  PointArrays p;
  p.layout = {{"red", ScalarType::uint8},   {"green", ScalarType::uint8}, {"blue", ScalarType::uint8},
              {"alpha", ScalarType::uint8}, {"ring", ScalarType::int16},  {"heat", ScalarType::float32},
              {"id", ScalarType::uint32}};
  p.samples.attributes.resize(p.layout.size());
  for (std::size_t i = 0; i < count; ++i) {
    SampleBatch& s = p.samples;
    for (auto* a : {&s.x, &s.y, &s.z}) a->push_back(static_cast<float>(size * uniform(random)));
    for (auto* a : {&s.nx, &s.ny, &s.nz}) a->push_back(uniform(random));
    s.radius.push_back(0.01F + std::abs(uniform(random)));
    s.quality.push_back(std::abs(uniform(random)));
    for (std::size_t c = 0; c < 4; ++c) s.attributes[c].push_back(static_cast<float>(random() % 256));
    s.attributes[4].push_back(static_cast<float>(static_cast<int>(random() % 1000) - 500));
    s.attributes[5].push_back(uniform(random));
    s.attributes[6].push_back(static_cast<float>(random() % (1 << 24)));
  }
  return p;
}

class PointVolumes : public ::testing::Test {
 protected:
  PointVolume round_trip(const PointArrays& p, const PointVolumeSettings& settings = {}) {
    stats_ = write_point_volume(p, settings, path_);
    return read_point_volume(path_);
  }
  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "points.vdb";
  PointVolumeStats stats_;
};

TEST_F(PointVolumes, BringBackEveryBit) {
  for (const double size : {1e-6, 3.0, 7e8}) {
    PointArrays p = random_points(2000, 1, size);
    p.samples.x[0] = p.samples.y[0] = p.samples.z[0] = 0;
    const PointVolume back = round_trip(p);
    EXPECT_TRUE(rows(p) == rows(back.points)) << size;
    EXPECT_TRUE(back.skipped.empty());
    std::map<std::string, ScalarType> expected, found;
    for (const auto& a : p.layout) expected[a.name] = a.type;
    for (const auto& a : back.points.layout) found[a.name] = a.type;
    EXPECT_EQ(found, expected);
  }
  EXPECT_EQ(stats_.points, 2000U);
}

RC_GTEST_FIXTURE_PROP(PointVolumes, BringBackFloatsWhateverTheVoxel, ()) {
  const auto count = *rc::gen::inRange<std::size_t>(1, 40);
  PointArrays p = random_points(count, *rc::gen::arbitrary<unsigned>(), std::exp2(*rc::gen::inRange(-20, 20)));
  PointVolumeSettings settings;
  settings.voxel = *rc::gen::inRange(0, 2) * std::exp2(*rc::gen::inRange(-4, 10)) * p.samples.radius[0];
  RC_ASSERT(rows(p) == rows(round_trip(p, settings).points));
}

TEST_F(PointVolumes, KeepGeoreferencedCoordinates) {
  constexpr std::size_t kCount = 300;
  std::mt19937 random(4);
  std::uniform_real_distribution<> uniform(0, 40);
  PointArrays p;
  for (std::size_t i = 0; i < kCount; ++i) {
    p.samples.x.push_back(431000.123 + uniform(random));
    p.samples.y.push_back(5213000.456 + uniform(random));
    p.samples.z.push_back(800 + uniform(random));
  }
  // A voxel so small that numbers counted from the origin would not fit.
  for (const double voxel : {0.0, 0.5, 1e-3}) {
    PointVolume back = round_trip(p, {.voxel = voxel});
    ASSERT_EQ(back.points.samples.size(), kCount);
    std::vector<std::array<double, 3>> a, b;
    for (std::size_t i = 0; i < kCount; ++i) {
      a.push_back({p.samples.x[i], p.samples.y[i], p.samples.z[i]});
      b.push_back({back.points.samples.x[i], back.points.samples.y[i], back.points.samples.z[i]});
    }
    std::sort(a.begin(), a.end());
    std::sort(b.begin(), b.end());
    for (std::size_t i = 0; i < kCount; ++i)
      for (std::size_t k = 0; k < 3; ++k) ASSERT_NEAR(a[i][k], b[i][k], 1e-6);
  }
}

TEST_F(PointVolumes, AreTheSameBytesForAnyNumberOfThreads) {
  const PointArrays p = random_points(5000, 2);
  RunContext run;
  run.threads = 1;
  write_point_volume(p, {}, path_, run);
  const std::string one = test::read_text(path_);
  run.threads = 4;
  write_point_volume(p, {}, path_, run);
  EXPECT_TRUE(test::read_text(path_) == one);
}

TEST_F(PointVolumes, AreDescribed) {
  write_point_volume(random_points(500, 3), {.name = "scan", .voxel = 0.5}, path_);
  const VolumeInfo info = describe_volume(path_);
  ASSERT_EQ(info.grids.size(), 1U);
  const GridInfo& grid = info.grids[0];
  EXPECT_TRUE(grid.points);
  EXPECT_EQ(grid.name, "scan");
  EXPECT_EQ(grid.point_count, 500U);
  EXPECT_TRUE(grid.uniform);
  EXPECT_EQ(grid.voxel[0], 0.5);
  std::vector<std::string> names;
  for (const auto& [name, type] : grid.attributes) names.push_back(name);
  EXPECT_THAT(names,
              ::testing::UnorderedElementsAre("P", "N", "pscale", "quality", "Cd", "Alpha", "ring", "heat", "id"));
}

TEST_F(PointVolumes, RefuseWhatCannotBeMeant) {
  RunContext run;
  const auto refusal = [&](const PointArrays& p, const PointVolumeSettings& settings = {}) -> std::string {
    try {
      write_point_volume(p, settings, path_, run);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  };
  const PointArrays good = random_points(10, 5);
  EXPECT_THAT(refusal({}), HasSubstr("no points"));
  EXPECT_THAT(refusal(good, {.name = ""}), HasSubstr("--name"));
  EXPECT_THAT(refusal(good, {.voxel = -1}), HasSubstr("--voxelsize"));
  EXPECT_THAT(refusal(random_points(10, 6, 1e6), {.voxel = 1e-12}), HasSubstr("too small"));
  run.max_memory = 10 << 20;  // a node of the tree for every point takes more
  EXPECT_THAT(refusal(random_points(200, 6, 1e6), {.voxel = 1}), HasSubstr("eight points a voxel"));
  run.max_memory = 0;
  PointArrays bad = good;
  bad.samples.y[7] = std::nan("");
  EXPECT_THAT(refusal(bad), HasSubstr("row 7"));
  bad = good;
  bad.samples.radius.pop_back();
  EXPECT_THAT(refusal(bad), HasSubstr("differ in length"));
  bad = good;
  bad.layout[5].name = "P";
  EXPECT_THAT(refusal(bad), HasSubstr("called P"));
  EXPECT_FALSE(std::filesystem::exists(path_));
  write_point_volume(good, {}, path_);
  EXPECT_THROW(read_point_volume(path_, "other"), Error);
}

}  // namespace
}  // namespace lamina
