// A mesh made in chunks is the mesh made whole, byte for byte.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "chunks/chunked.h"
#include "lamina/scatter.h"
#include "reconstruct/constants.h"
#include "reconstruct/stages.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

/// Long along z, so that it has many slabs; densities differ 64 times, colours, quality, noise.
Cloud long_cloud(std::size_t count, double length = 6) {
  std::mt19937 random(11);
  std::uniform_real_distribution<> uniform;
  std::normal_distribution<> noise(0, 0.003);
  Cloud cloud;
  while (cloud.size() < count) {
    const double z = length * uniform(random), a = 2 * std::numbers::pi * uniform(random);
    if (uniform(random) > std::exp2(-3 * (1 + std::sin(2 * z)))) continue;
    const double r = 0.3 + 0.1 * std::sin(3 * z) + noise(random);
    cloud.add({r * std::cos(a), r * std::sin(a), z}, {std::cos(a), std::sin(a), -0.3 * std::cos(3 * z)});
  }
  cloud.add_property("red", ScalarType::uint8, [](const Point3& p) { return std::floor(127 + 200 * p[0]); });
  cloud.add_property("confidence", ScalarType::float32, [](const Point3& p) { return 1 + p[1]; });
  return cloud;
}

/// Hundreds of small spheres, each a component of its own.
Cloud pearls(std::size_t spheres, std::size_t samples_each) {
  std::mt19937 random(13);
  std::uniform_real_distribution<> uniform;
  Cloud cloud;
  for (std::size_t s = 0; s < spheres; ++s) {
    const Point3 centre{uniform(random), uniform(random), 5 * uniform(random)};
    const double radius = 0.02 + 0.03 * uniform(random);
    for (std::size_t i = 0; i < samples_each; ++i) {
      const Point3 n = test::random_direction(random);
      cloud.add({centre[0] + radius * n[0], centre[1] + radius * n[1], centre[2] + radius * n[2]}, n);
    }
  }
  return cloud;
}

/// Samples and normals at random in a column: no surface, all kinds of loops, fans and rejected cells.
Cloud dust(std::size_t count) {
  std::mt19937 random(17);
  std::uniform_real_distribution<> uniform;
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i)
    cloud.add({0.3 * uniform(random), 0.3 * uniform(random), 4 * uniform(random)}, test::random_direction(random));
  return cloud;
}

class ChunkIdentity : public ::testing::Test {
 protected:
  void expect_same(const Cloud& cloud, SurfaceSettings settings, const std::vector<int>& counts) {
    settings.input = test::write_cloud(cloud, folder_ / "in.ply");
    expect_same_of(settings, counts);
  }
  void expect_same_of(const SurfaceSettings& settings, const std::vector<int>& counts) {
    const std::string whole = test::whole_bytes(settings, folder_);
    ASSERT_GT(whole.size(), 1000u) << whole;
    const std::string store = folder_ / fmt::format("store{}", stores_++);
    plan_ = write_store(settings, store, {}).plan;
    slabs_ = plan_.slabs;
    for (const int count : counts) {
      const auto parts = test::make_parts(settings, store, count, folder_);
      EXPECT_TRUE(test::merged_bytes(parts, folder_) == whole) << count << " chunks of " << slabs_ << " slabs";
    }
  }
  test::TemporaryFolder folder_;
  SurfacePlan plan_;
  std::int64_t slabs_ = 0;
  int stores_ = 0;
};

TEST_F(ChunkIdentity, VaryingDensity) {
  expect_same(long_cloud(8000), {}, {1, 2, 7});
  EXPECT_GT(slabs_, 20);
}

TEST_F(ChunkIdentity, EverySlabItsOwnChunk) {
  SurfaceSettings s;
  s.levels = 3;
  expect_same(long_cloud(1500, 2), s, {30});
  EXPECT_GT(slabs_, 8);
}

TEST_F(ChunkIdentity, WithoutClustering) {
  SurfaceSettings s;
  s.cluster = ClusterMode::none;
  expect_same(long_cloud(4000), s, {5});
}

TEST_F(ChunkIdentity, FreeClustering) {
  SurfaceSettings s;
  s.cluster = ClusterMode::free;
  expect_same(long_cloud(4000), s, {5});
}

TEST_F(ChunkIdentity, Diffusion) {
  SurfaceSettings s;
  s.diffuse = true;
  expect_same(long_cloud(4000), s, {5});
}

TEST_F(ChunkIdentity, SeveralStepsAndWideSupport) {
  SurfaceSettings s;
  s.steps = 3;
  s.blend = 2;
  expect_same(long_cloud(4000), s, {5});
}

TEST_F(ChunkIdentity, CellsThatFollowTheRadiusAlone) {
  SurfaceSettings s;
  s.blend = 3;
  s.cell = {0.9, Length::Unit::sample_radius};
  s.boundary = 0.7;
  expect_same(long_cloud(3000), s, {6});
}

TEST_F(ChunkIdentity, OneSizeOfCells) {
  SurfaceSettings s;
  s.cell = {0.02, Length::Unit::world};
  s.window = 3;
  expect_same(long_cloud(4000), s, {6});
}

TEST_F(ChunkIdentity, OneLevel) {
  SurfaceSettings s;
  s.levels = 1;
  expect_same(long_cloud(4000, 2), s, {9});
}

TEST_F(ChunkIdentity, ManyComponents) {
  expect_same(pearls(80, 50), {}, {2, 7});
}

TEST_F(ChunkIdentity, SamplesOnNoSurface) {
  for (const ClusterMode mode : {ClusterMode::preserving, ClusterMode::free}) {
    SurfaceSettings s;
    s.cluster = mode;
    expect_same(dust(1500), s, {7});
  }
}

TEST_F(ChunkIdentity, ChosenByTheNoise) {
  Cloud cloud = long_cloud(6000, 3);
  std::mt19937 random(19);
  std::uniform_real_distribution<> uniform(-0.04, 0.04);
  for (Point3& p : cloud.positions) {
    for (double& c : p) c += uniform(random);
  }
  SurfaceSettings s;
  s.blend.reset();
  expect_same(cloud, s, {3});
  EXPECT_LT(plan_.least_blend, plan_.most_blend) << plan_.noise;
}

TEST_F(ChunkIdentity, OfAClosedThingWithHoles) {
  const Cloud whole = test::sphere_cloud(12000);
  Cloud pierced;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const Point3 &p = whole.positions[i], &gap = whole.positions[1000 * (i / 6000)];
    if (std::hypot(p[0] - gap[0], p[1] - gap[1], p[2] - gap[2]) > 0.1) pierced.add(p, whole.normals[i]);
  }
  SurfaceSettings s;
  s.blend.reset();
  expect_same(pierced, s, {2, 5});
  EXPECT_EQ(plan_.blend, 1) << "half cells where things are thin, and all rims closed";
}

/// A bar with eight long edges and normals that are interpolated over them.
Cloud octagonal_bar(std::size_t count) {
  std::mt19937 random(23);
  std::uniform_real_distribution<> u(-1, 1);
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double a = static_cast<double>(random() % 8) * std::numbers::pi / 4;
    const double t = u(random) * std::tan(std::numbers::pi / 8);
    const double z = 2 * u(random);
    const double turn = 0.3 * std::pow(t / std::tan(std::numbers::pi / 8), 3);
    cloud.add({0.4 * (std::cos(a) - t * std::sin(a)), 0.4 * (std::sin(a) + t * std::cos(a)), z},
              {std::cos(a + turn), std::sin(a + turn), 0});
  }
  return cloud;
}

TEST_F(ChunkIdentity, SharpEdges) {
  SurfaceSettings s;
  s.features = true;
  expect_same(octagonal_bar(12000), s, {2, 7});
  EXPECT_TRUE(plan_.features);
  EXPECT_TRUE(plan_.sharpen) << plan_.blurred_normals;
}

TEST_F(ChunkIdentity, RadiiThatTheInputGives) {
  Cloud cloud = long_cloud(4000);
  cloud.add_property("radius", ScalarType::float32, [](const Point3& p) { return 0.05 + 0.03 * std::sin(5 * p[2]); });
  SurfaceSettings s;
  s.radius_scale = 1.1;
  expect_same(cloud, s, {5});
}

TEST_F(ChunkIdentity, GeoreferencedAndUndersampled) {
  Cloud cloud = long_cloud(4000);
  for (Point3& p : cloud.positions) p[0] += 5e6, p[1] += 4e5;
  SurfaceSettings s;
  s.max_radius = {2.0, Length::Unit::sample_radius};
  s.input = test::write_cloud(cloud, folder_ / "in.ply", PlyFormat::little_endian, ScalarType::float64);
  expect_same_of(s, {4});
}

}  // namespace
}  // namespace lamina
