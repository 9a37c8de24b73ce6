// What samples carry besides position and normal arrives on the vertices, in its own type and range.
#include <gtest/gtest.h>

#include "lamina/error.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;
using test::reconstruct;
using test::Reconstruction;

/// A ramp over the unit ball from 0 to 1 along a direction.
struct Ramp {
  Point3 direction;
  double operator()(const Point3& p) const {
    return 0.5 + 0.5 * (direction[0] * p[0] + direction[1] * p[1] + direction[2] * p[2]);
  }
};

struct Carried {
  std::string name;
  ScalarType type;
  double scale;  // of the ramp
  Ramp ramp;
};

void expect_ramps(const Reconstruction& r, const std::vector<Carried>& carried, std::size_t first) {
  ASSERT_EQ(r.mesh.layout.size(), first + carried.size());
  for (std::size_t a = 0; a < carried.size(); ++a) {
    const Carried& c = carried[a];
    EXPECT_EQ(r.mesh.layout[first + a], (AttributeSpec{c.name, c.type}));
    const auto& values = r.mesh.attributes[first + a];
    double mean_error = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double error = std::abs(values[i] / c.scale - c.ramp(r.mesh.positions[i]));
      // The average over a ball of radius R about a corner less than R away.
      ASSERT_LT(error, r.stats.plan.radius_median) << c.name;
      mean_error += error / static_cast<double>(values.size());
    }
    EXPECT_LT(mean_error, 0.15 * r.stats.plan.radius_median) << c.name;
  }
}

std::vector<Carried> colours(ScalarType type, double scale) {
  return {{"red", type, scale, {{1, 0, 0}}},
          {"green", type, scale, {{0, 1, 0}}},
          {"blue", type, scale, {{0, 0, 1}}},
          {"alpha", type, scale, {{0.6, 0.8, 0}}}};
}

Cloud cloud_with(const std::vector<Carried>& carried) {
  Cloud cloud = test::sphere_cloud(6000);
  for (const Carried& c : carried) {
    cloud.add_property(c.name, c.type, [&](const Point3& p) {
      const double v = c.scale * c.ramp(p);
      return c.type == ScalarType::float32 || c.type == ScalarType::float64 ? v : std::round(v);
    });
  }
  return cloud;
}

TEST(SurfaceAttributes, ColoursOfEveryTypeArriveInIt) {
  for (const auto& [type, scale] : std::vector<std::pair<ScalarType, double>>{
           {ScalarType::uint8, 255}, {ScalarType::uint16, 65535}, {ScalarType::float32, 1}}) {
    const auto carried = colours(type, scale);
    expect_ramps(reconstruct(cloud_with(carried)), carried, 0);
  }
}

TEST(SurfaceAttributes, FurtherScalarsOfAnyTypeAreCarriedInOrder) {
  const std::vector<Carried> carried{{"scalar_intensity", ScalarType::float32, 1e4, {{0, 0, 1}}},
                                     {"temperature", ScalarType::float64, -40, {{0, 1, 0}}},
                                     {"small", ScalarType::int8, -100, {{1, 0, 0}}},
                                     {"time", ScalarType::uint32, 3e9, {{0.6, 0, 0.8}}},
                                     {"signed", ScalarType::int32, -2e9, {{-1, 0, 0}}},
                                     {"class", ScalarType::int16, 3e4, {{0, -1, 0}}},
                                     {"red", ScalarType::uint8, 255, {{0, 0, -1}}}};
  const Cloud cloud = cloud_with(carried);
  for (const bool diffuse : {false, true}) {
    for (const ClusterMode cluster : {ClusterMode::none, ClusterMode::free, ClusterMode::preserving}) {
      SurfaceSettings s;
      s.diffuse = diffuse;
      s.cluster = cluster;
      expect_ramps(reconstruct(cloud, s), carried, 0);
    }
  }
}

// An average of equal values is that value: whatever is out by one was rounded down.
TEST(SurfaceAttributes, ConstantsStayExact) {
  Cloud cloud = test::sphere_cloud(4000);
  const std::vector<std::pair<AttributeSpec, double>> constants{{{"red", ScalarType::uint8}, 255},
                                                                {{"green", ScalarType::uint8}, 1},
                                                                {{"wide", ScalarType::uint16}, 65535},
                                                                {{"minus", ScalarType::int16}, -12345}};
  for (const auto& [spec, value] : constants) {
    cloud.add_property(spec.name, spec.type, [v = value](const Point3&) { return v; });
  }
  for (const int steps : {1, 2}) {
    SurfaceSettings s;
    s.steps = steps;
    const Reconstruction r = reconstruct(cloud, s);
    for (std::size_t a = 0; a < constants.size(); ++a) {
      for (const float v : r.mesh.attributes[a]) ASSERT_EQ(v, constants[a].second) << constants[a].first.name;
    }
  }
}

// A sixteenth of the density is four times the spacing, and cells two levels coarser.
TEST(SurfaceAttributes, VerticesCarryTheirOctreeLevel) {
  Cloud cloud = test::sphere_cloud(12000, [](const Point3& v) { return v[2] > 0 ? 1.0 : 1.0 / 16; });
  cloud.add_property("heat", ScalarType::uint8, [](const Point3&) { return 7; });
  SurfaceSettings s;
  s.vertex_levels = true;
  for (const ClusterMode cluster : {ClusterMode::none, ClusterMode::preserving}) {
    s.cluster = cluster;
    const Reconstruction r = reconstruct(cloud, s);
    ASSERT_EQ(r.mesh.layout.size(), 2U);
    EXPECT_EQ(r.mesh.layout[1].name, "level");
    EXPECT_EQ(r.mesh.layout[1].type, ScalarType::uint8);
    std::array<double, 2> sum{}, count{};
    for (std::size_t i = 0; i < r.mesh.positions.size(); ++i) {
      ASSERT_EQ(r.mesh.attributes[0][i], 7);
      const float level = r.mesh.attributes[1][i];
      ASSERT_LT(level, static_cast<float>(r.stats.plan.levels));
      const double z = r.mesh.positions[i][2];
      if (std::abs(z) < 0.6) continue;  // cells pass from one size to the other
      sum[z > 0 ? 0 : 1] += static_cast<double>(level), ++count[z > 0 ? 0 : 1];
    }
    EXPECT_NEAR(sum[1] / count[1] - sum[0] / count[0], 2, 0.5);
  }
  cloud.add_property("level", ScalarType::uint8, [](const Point3&) { return 1; });
  EXPECT_THROW(reconstruct(cloud, s), Error);
}

// Other programs write NaN where a sample has no value; the mesh must hold numbers all the same.
TEST(SurfaceAttributes, ValuesThatAreNoNumbersAreReplacedAndCounted) {
  Cloud cloud = test::sphere_cloud(4000);
  cloud.add_property("height", ScalarType::float32, [](const Point3& p) { return p[2]; });
  const double nan = std::nan("");
  const double infinity = std::numeric_limits<double>::infinity();
  cloud.values[0][7] = nan;
  cloud.values[0][8] = infinity;
  cloud.values[0][9] = -3e38;
  std::string said;
  RunContext run;
  run.log = [&](LogLevel level, std::string_view text) {
    if (level == LogLevel::warning) said += text;
  };
  const Reconstruction r = reconstruct(cloud, {}, run);
  EXPECT_EQ(r.stats.replaced_attributes, 3u);
  EXPECT_EQ(r.stats.plan.samples, 4000u);
  EXPECT_NE(said.find("3 attribute values"), std::string::npos) << said;
  EXPECT_NE(said.find("row 7"), std::string::npos) << said;
  for (const float v : r.mesh.attributes[0]) ASSERT_TRUE(std::isfinite(v));
  SurfaceSettings refuse;
  refuse.bad_samples = BadSamples::refuse;
  EXPECT_THROW(reconstruct(cloud, refuse), Error);
}

// Normals that were never oriented alike: the job goes on, but says so and where it is worst.
TEST(SurfaceAttributes, ContradictingNormalsAreReported) {
  std::string said;
  RunContext run;
  run.log = [&](LogLevel level, std::string_view text) {
    if (level == LogLevel::warning) said += text;
  };
  Cloud cloud = test::sphere_cloud(20000);
  const Reconstruction alike = reconstruct(cloud, {}, run);
  EXPECT_EQ(alike.stats.corners_torn, 0u);
  EXPECT_EQ(said, "");
  for (std::size_t i = 0; i < cloud.size(); i += 3) {
    for (double& n : cloud.normals[i]) n = -n;
  }
  SurfaceSettings as_they_are;
  as_they_are.normals = NormalsChoice::file;
  const Reconstruction mixed = reconstruct(cloud, as_they_are, run);
  EXPECT_GT(mixed.stats.corners_torn, mixed.stats.corners_seen / 10);
  EXPECT_GE(mixed.stats.torn_share * static_cast<double>(mixed.stats.corners_seen),
            static_cast<double>(mixed.stats.corners_torn));
  EXPECT_NE(said.find("normals contradict each other"), std::string::npos) << said;
  as_they_are.steps = 4;
  const Reconstruction stepped = reconstruct(cloud, as_they_are, run);
  EXPECT_GT(stepped.stats.corners_torn, 0u);
  EXPECT_LE(stepped.stats.corners_torn, stepped.stats.corners_seen);
  EXPECT_LE(stepped.stats.torn_share, 1.0);
}

}  // namespace
}  // namespace lamina
