#include "tiles/georeference.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace lamina::tiles {
namespace {

double degrees(double d, double m, double s) {
  return d + m / 60 + s / 3600;
}

// The worked examples of IOGP's guidance note 7-2 (geomatics).
TEST(Georeference, TransverseMercatorAsInTheGuidanceNote) {
  MapPlane plane;
  plane.half_axis = 6377563.396;
  plane.inverse_flattening = 299.3249646;
  plane.latitude = 49;
  plane.longitude = -2;
  plane.scale = 0.9996012717;
  plane.east = 400000;
  plane.north = -100000;
  const auto [longitude, latitude] = to_degrees(plane, 577274.99, 69740.50);
  EXPECT_NEAR(longitude, degrees(0, 30, 0), 2e-7);
  EXPECT_NEAR(latitude, degrees(50, 30, 0), 2e-7);
}

TEST(Georeference, GeocentricAsInTheGuidanceNote) {
  const auto at = geocentric({}, degrees(2, 7, 46.380), degrees(53, 48, 33.820), 73);
  EXPECT_NEAR(at[0], 3771793.968, 0.01);
  EXPECT_NEAR(at[1], 140253.342, 0.01);
  EXPECT_NEAR(at[2], 5124304.349, 0.01);
}

TEST(Georeference, SystemsByNumberAndByText) {
  const auto utm = map_plane("EPSG:32719");
  ASSERT_TRUE(utm);
  EXPECT_EQ(utm->longitude, -69);
  EXPECT_EQ(utm->north, 1e7);
  EXPECT_FALSE(map_plane("EPSG:2056"));   // Switzerland's, oblique
  EXPECT_FALSE(map_plane("EPSG:32661"));  // polar
  EXPECT_FALSE(map_plane(""));
  const std::string text =
      "COMPD_CS[\"x\",PROJCS[\"NAD83(2011) / UTM zone 10N\",GEOGCS[\"NAD83(2011)\",DATUM[\"NAD83_National_Spatial\","
      "SPHEROID[\"GRS 1980\",6378137,298.257222101]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],"
      "PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",-123],"
      "PARAMETER[\"scale_factor\",0.9996],PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",0],"
      "UNIT[\"metre\",1,AUTHORITY[\"EPSG\",\"9001\"]],AXIS[\"Easting\",EAST]],VERT_CS[\"NAVD88\",UNIT[\"foot\",0.3]]]";
  const auto plane = map_plane(text);
  ASSERT_TRUE(plane);
  EXPECT_EQ(plane->longitude, -123);
  EXPECT_EQ(plane->scale, 0.9996);
  EXPECT_EQ(plane->east, 500000);
  EXPECT_EQ(plane->unit, 1);
  EXPECT_EQ(plane->inverse_flattening, 298.257222101);
  std::string bessel = text;
  for (std::size_t at = bessel.find("NAD83"); at != std::string::npos; at = bessel.find("NAD83"))
    bessel.replace(at, 5, "DHDN.");
  EXPECT_FALSE(map_plane(bessel));  // its centre is elsewhere
}

// The transform of a place beside the origin agrees with the place itself.
TEST(Georeference, TransformFollowsTheProjection) {
  const auto plane = map_plane("EPSG:32633");
  ASSERT_TRUE(plane);
  const meshes::Vec3 origin{300000, 5600000, 200};
  const Matrix4 m = to_earth(*plane, origin);
  const meshes::Vec3 step{300, -200, 50};
  const auto [longitude, latitude] = to_degrees(*plane, origin[0] + step[0], origin[1] + step[1]);
  const auto there = geocentric(*plane, longitude, latitude, origin[2] + step[2]);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(m[k] * step[0] + m[4 + k] * step[1] + m[8 + k] * step[2] + m[12 + k], there[k], 0.02);
}

}  // namespace
}  // namespace lamina::tiles
