// From the plane of a map to the Earth.
#pragma once
#include <array>
#include <optional>
#include <string>

#include "meshes/vec3.h"

namespace lamina::tiles {

/// Four columns of four, as glTF and 3D Tiles have them.
using Matrix4 = std::array<double, 16>;

/// Transverse Mercator on an ellipsoid of the Earth's size about its centre.
struct MapPlane {
  double half_axis = 6378137, inverse_flattening = 298.257223563;
  double longitude = 0, latitude = 0;  ///< of the origin, degrees
  double scale = 1;                    ///< along the middle meridian
  double east = 0, north = 0;          ///< of the origin, metres
  double unit = 1;                     ///< metres of one
};

/// What a coordinate reference system (PointSourceInfo::crs) says, well-known text of either generation or the number
/// of a UTM zone (WGS 84, ETRS89, NAD83). Nothing where it is another projection, or on another datum, which would want
/// a shift of its own.
std::optional<MapPlane> map_plane(const std::string& crs);

/// Longitude and latitude, degrees, of a place on the plane: the series of Krueger (1912), to less than a millimetre as
/// far as 3000 km from the middle meridian.
std::array<double, 2> to_degrees(const MapPlane& plane, double x, double y);

/// Geocentric coordinates, metres (ECEF, EPSG 4978).
meshes::Vec3 geocentric(const MapPlane& plane, double longitude, double latitude, double height);

/// Takes coordinates less `origin` to geocentric ones: east, north and up where the origin is, turned by the meridian's
/// convergence and stretched as the projection is there.
Matrix4 to_earth(const MapPlane& plane, const meshes::Vec3& origin);

}  // namespace lamina::tiles
