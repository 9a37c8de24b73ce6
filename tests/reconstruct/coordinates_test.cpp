// Georeferenced clouds: the surface keeps a tenth of a millimetre, wherever on earth it lies.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "lamina/error.h"
#include "lamina/volume_tools.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

constexpr Point3 kGeocentric{4'157'222.5432, 664'789.3074, 4'774'952.0994};
constexpr Point3 kUtm{4'468'298.123, 5'412'345.678, 412.3};

/// A sphere of ten metres around a place on earth.
Cloud ten_metres(const Point3& centre) {
  Cloud cloud = test::sphere_cloud(4000);
  for (Point3& p : cloud.positions) {
    for (std::size_t k = 0; k < 3; ++k) p[k] = centre[k] + 10 * p[k];
  }
  return cloud;
}

TriangleMesh surface_of(const Cloud& cloud, SurfaceSettings settings, SurfaceStats& stats,
                        const test::TemporaryFolder& folder) {
  settings.input = test::write_cloud(cloud, folder / "in.ply", PlyFormat::little_endian, ScalarType::float64);
  settings.output = folder / "out.ply";
  stats = reconstruct_surface(settings, {});
  return read_mesh(settings.output);
}

double error_at(const TriangleMesh& mesh, const Point3& centre) {
  return test::deviation(mesh,
                         [&](const Point3& p) {
                           return std::abs(std::hypot(p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]) - 10);
                         })
      .largest;
}

TEST(Coordinates, MovedFarAwayTheMeshIsTheSameToATenthOfAMillimetre) {
  const test::TemporaryFolder folder;
  SurfaceStats stats;
  const TriangleMesh near = surface_of(ten_metres({0, 0, 0}), {}, stats, folder);
  for (const Point3& centre : {kGeocentric, kUtm, Point3{-6e6, 6e6, 1e3}}) {
    const TriangleMesh far = surface_of(ten_metres(centre), {}, stats, folder);
    ASSERT_EQ(far.triangles.size(), near.triangles.size());
    ASSERT_EQ(far.positions.size(), near.positions.size());
    double farthest = 0;
    for (std::size_t v = 0; v < far.positions.size(); ++v) {
      for (std::size_t k = 0; k < 3; ++k)
        farthest = std::max(farthest, std::abs(far.positions[v][k] - centre[k] - near.positions[v][k]));
    }
    EXPECT_LT(farthest, 1e-4);
    EXPECT_THAT(test::read_file(folder / "out.ply").substr(0, 400), ::testing::HasSubstr("property double x"));
  }
}

TEST(Coordinates, TurnedToTheEarthsSurfaceTheErrorsAreTheSame) {
  // Up on the cloud's axis becomes up in geocentric coordinates at 48.8 degrees north, 9.1 east.
  const test::TemporaryFolder folder;
  SurfaceStats stats;
  Cloud cloud = test::torus_cloud(6000);
  const TriangleMesh flat = surface_of(cloud, {}, stats, folder);
  const double lat = 48.8 * std::numbers::pi / 180, lon = 9.1 * std::numbers::pi / 180;
  const std::array<Point3, 3> axes{{{-std::sin(lon), std::cos(lon), 0},
                                    {-std::sin(lat) * std::cos(lon), -std::sin(lat) * std::sin(lon), std::cos(lat)},
                                    {std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat)}}};
  const auto turned = [&](const Point3& p) {
    Point3 q{};
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t k = 0; k < 3; ++k) q[k] += axes[a][k] * p[a];
    }
    return q;
  };
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.positions[i] = turned(cloud.positions[i]);
    for (std::size_t k = 0; k < 3; ++k) cloud.positions[i][k] += kGeocentric[k];
    cloud.normals[i] = turned(cloud.normals[i]);
  }
  const TriangleMesh far = surface_of(cloud, {}, stats, folder);
  const auto distance = [&](const Point3& p) {
    Point3 q{};
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t k = 0; k < 3; ++k) q[a] += axes[a][k] * (p[k] - kGeocentric[k]);
    }
    return test::distance_to_torus(q);
  };
  EXPECT_NEAR(test::deviation(far, distance).rms, test::deviation(flat, test::distance_to_torus).rms, 1e-4);
}

TEST(Coordinates, LocalOnesAreFloatsAndTheShiftIsEverywhere) {
  const test::TemporaryFolder folder;
  SurfaceSettings settings;
  settings.local = true;
  settings.volume.path = folder / "out.vdb";
  settings.volume.points = folder / "points.vdb";
  SurfaceStats stats;
  const TriangleMesh mesh = surface_of(ten_metres(kUtm), settings, stats, folder);
  EXPECT_EQ(stats.shift, (std::array<double, 3>{4468300, 5412350, 410}));
  const std::string header = test::read_file(folder / "out.ply").substr(0, 600);
  EXPECT_THAT(header, ::testing::AllOf(::testing::HasSubstr("property float x"),
                                       ::testing::HasSubstr("comment shift 4468300 5412350 410\n")));
  const Point3 centre{kUtm[0] - stats.shift[0], kUtm[1] - stats.shift[1], kUtm[2] - stats.shift[2]};
  const TriangleMesh whole = surface_of(
      ten_metres(kUtm),
      [] {
        SurfaceSettings s;
        s.frame = FrameMode::axis;  // as with a volume
        return s;
      }(),
      stats, folder);
  EXPECT_NEAR(error_at(mesh, centre), error_at(whole, kUtm), 1e-4);
  for (const std::string& name : {settings.volume.path, settings.volume.points}) {
    const VolumeInfo info = describe_volume(name);
    ASSERT_FALSE(info.grids.empty());
    for (const auto& grid : info.grids) {
      EXPECT_TRUE(std::any_of(
          grid.metadata.begin(), grid.metadata.end(),
          [](const auto& m) { return m.first == "shift" && m.second.find("4.4683e+06") != std::string::npos; }))
          << name << " " << grid.name;
    }
  }
}

}  // namespace
}  // namespace lamina
