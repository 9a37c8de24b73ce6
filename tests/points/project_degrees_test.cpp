// Longitude and latitude to metres: published values, arcs integrated by brute force, and what is no degrees.
#include "points/formats.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "base/temporary_folder.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

using test::all_rows;
using testing::AllOf;
using testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180;

struct Globe {
  double half_axis, inverse_flattening;
  [[nodiscard]] double e2() const { return (2 - 1 / inverse_flattening) / inverse_flattening; }
};

constexpr Globe kWgs84{6378137, 298.257223563};

/// From the equator along a meridian, by the midpoint rule.
double meridian_arc(const Globe& globe, double latitude) {
  constexpr int kPieces = 20000;
  double sum = 0;
  for (int i = 0; i < kPieces; ++i) {
    const double s = std::sin((i + 0.5) / kPieces * latitude * kDegree);
    sum += std::pow(1 - globe.e2() * s * s, -1.5);
  }
  return globe.half_axis * (1 - globe.e2()) * sum * latitude * kDegree / kPieces;
}

class ProjectDegrees : public ::testing::Test {
 protected:
  /// A PLY of the places, as x y z of double.
  std::string file(const std::vector<std::array<double, 3>>& places, const std::string& crs = {},
                   const std::string& name = "a.ply") const {
    SampleBatch rows;
    for (const auto& p : places) rows.x.push_back(p[0]), rows.y.push_back(p[1]), rows.z.push_back(p[2]);
    test::write_rows(folder_ / name, {.double_positions = true}, rows, {.crs = crs});
    return folder_ / name;
  }
  test::TemporaryFolder folder_;
  const PointSettings settings_{.project_degrees = true};
};

TEST_F(ProjectDegrees, SnydersExample) {
  // Map Projections - A Working Manual (1987), page 269: Clarke 1866, 40 30 N 73 30 W from 75 W, scale 0.9996.
  const Globe clarke{6378206.4, 294.9786982};
  const std::string crs =
      "GEOGCS[\"NAD27\",DATUM[\"d\",SPHEROID[\"Clarke 1866\",6378206.4,294.9786982]],PRIMEM[\"G\",0]]";
  const SampleBatch rows = all_rows(file({{-75.0, 40.0, 5.0}, {-73.5, 40.5, 7.0}}, crs), settings_);
  EXPECT_NEAR(rows.x[0], 0, 1e-9);
  EXPECT_NEAR(rows.y[0], 0, 1e-9);
  EXPECT_NEAR(rows.x[1], 127106.5 / 0.9996, 0.1);
  EXPECT_NEAR(rows.y[1], 4484124.4 / 0.9996 - meridian_arc(clarke, 40), 0.1);
  EXPECT_EQ(rows.z[1], 7);
}

TEST_F(ProjectDegrees, IsTrueToScaleAlongItsMiddle) {
  for (const double latitude : {0.0, 47.0, -33.0, 70.0}) {
    const SampleBatch rows = all_rows(
        file({{8, latitude, 0}, {8, latitude + 0.5, 0}, {8.001, latitude, 0}, {-352, latitude - 1, 0}}), settings_);
    EXPECT_NEAR(rows.y[1], meridian_arc(kWgs84, latitude + 0.5) - meridian_arc(kWgs84, latitude), 1e-3);
    EXPECT_NEAR(rows.y[3], meridian_arc(kWgs84, latitude - 1) - meridian_arc(kWgs84, latitude), 1e-3);
    const double s = std::sin(latitude * kDegree);
    const double across = kWgs84.half_axis / std::sqrt(1 - kWgs84.e2() * s * s) * std::cos(latitude * kDegree);
    EXPECT_NEAR(rows.x[2], 0.001 * kDegree * across, 1e-3);
    EXPECT_NEAR(rows.x[3], 0, 1e-6) << "a whole turn";
  }
}

TEST_F(ProjectDegrees, SeveralFilesComeIntoOnePlane) {
  const std::string west = file({{7.4, 47.2, 0}}), east = file({{7.6, 47.2, 0}, {7.6, 47.6, 0}}, {}, "b.ply");
  const auto both = open_points({west, east}, settings_);
  const SampleBatch rows = all_rows(*both);
  EXPECT_NEAR(rows.x[1] - rows.x[0], 15160, 15);
  EXPECT_THAT(both->info().crs, HasSubstr("central_meridian\",7]"));
  EXPECT_FALSE(both->info().geographic);
  const auto text = open_points(test::write_file(folder_ / "c.xyz", "x y z\n7.4 47.2 0\n7.6 47.2 0\n"), settings_);
  EXPECT_EQ(all_rows(*text, 1).x[1], rows.x[1]);
}

TEST_F(ProjectDegrees, WhatIsNoPlaceIsRefusedByItsRow) {
  EXPECT_THAT(test::refusal(file({{8, 47, 0}, {8, 200, 0}}), settings_), AllOf(HasSubstr("row 2"), HasSubstr("8 200")));
  EXPECT_THAT(test::refusal(file({{8, 47, 0}, {0, 0, 0}}), settings_), HasSubstr("too far for one plane"));
  EXPECT_THAT(test::refusal(file({{400000, 5e6, 0}}), settings_), HasSubstr("no longitude and latitude"));
  EXPECT_THAT(test::refusal(file({{8, 47, 0}}), settings_), "");
  const std::string utm = folder_ / "utm.las";
  test::write_rows(utm, {.double_positions = true}, test::random_rows({.double_positions = true}, 5, 1),
                   {.crs = "EPSG:32632"});
  EXPECT_THAT(test::refusal(utm, settings_), HasSubstr("no degrees, but coordinates of EPSG:32632"));
}

TEST_F(ProjectDegrees, DegreesAreKnownByTheirSystem) {
  for (const char* crs : {"EPSG:4326", "GEOGCS[\"WGS 84\"]", "GEOGCRS[\"WGS 84\",CS[ellipsoidal,2]]"}) {
    EXPECT_TRUE(open_points(file({{8, 47, 0}}, crs))->info().geographic) << crs;
    EXPECT_THROW(require_no_degrees(open_points(file({{8, 47, 0}}, crs))->info()), Error);
  }
  for (const char* crs : {"", "EPSG:32632", "PROJCS[\"UTM\",GEOGCS[\"WGS 84\"]]", "GEODCRS[\"x\",CS[Cartesian,3]]"})
    EXPECT_FALSE(open_points(file({{8, 47, 0}}, crs))->info().geographic) << crs;
}

TEST_F(ProjectDegrees, NumbersOfSystemsAreKeptInLas) {
  for (const char* name : {"a.las", "a.laz"}) {
    const SampleBatch rows = test::random_rows({.double_positions = true}, 5, 1);
    test::write_rows(folder_ / name, {.double_positions = true}, rows, {.crs = "EPSG:32616"});
    const auto metres = open_points(folder_ / name);
    EXPECT_EQ(metres->info().crs, "EPSG:32616");
    EXPECT_FALSE(metres->info().geographic);
    EXPECT_EQ(all_rows(*metres).size(), 5);
    test::write_rows(folder_ / name, {.double_positions = true}, rows, {.crs = "EPSG:6318", .geographic = true});
    const auto degrees = open_points(folder_ / name);
    EXPECT_EQ(degrees->info().crs, "EPSG:6318");
    EXPECT_TRUE(degrees->info().geographic);
    for (const char* odd : {"EPSG:32767", "EPSG:99999", "EPSG:", "EPSG:3x", "somewhere"}) {
      test::write_rows(folder_ / name, {.double_positions = true}, rows, {.crs = odd});
      EXPECT_EQ(open_points(folder_ / name)->info().crs, "") << odd;
    }
  }
}

}  // namespace
}  // namespace lamina
