#include "tiles/georeference.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <numbers>
#include <string_view>

#include "points/transverse_mercator.h"

namespace lamina::tiles {
namespace {

using meshes::Vec3;
using meshes::operator-;
using meshes::operator*;

constexpr double kRadian = std::numbers::pi / 180;

/// Along the middle meridian from the equator, in radii.
double meridian(const Krueger& series, double latitude) {
  const double s = std::sin(latitude * kRadian);
  const double xi = std::atan(std::sinh(std::atanh(s) - series.eccentricity * std::atanh(series.eccentricity * s)));
  double sum = xi;
  for (std::size_t j = 0; j < series.to.size(); ++j)
    sum += series.to[j] * std::sin(2 * (static_cast<double>(j) + 1) * xi);
  return sum;
}

std::string lower_case(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return out;
}

/// The number behind the name in quotes that begins at `begin`: NAME",number.
std::optional<double> number_after_name(std::string_view text, std::size_t begin) {
  const std::size_t quote = text.find('"', begin);
  if (quote == std::string_view::npos || quote + 1 >= text.size() || text[quote + 1] != ',') return std::nullopt;
  std::size_t at = quote + 2;
  while (at < text.size() && text[at] == ' ') ++at;
  double value = 0;
  if (std::from_chars(text.data() + at, text.data() + text.size(), value).ec != std::errc()) return std::nullopt;
  return value;
}

std::optional<double> parameter(std::string_view text, std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names) {
    const std::string quoted = "parameter[\"" + std::string(name) + "\"";
    if (const std::size_t at = text.find(quoted); at != std::string_view::npos)
      return number_after_name(text, at + std::string_view("parameter[\"").size());
  }
  return std::nullopt;
}

/// The second argument behind the first of these words.
std::optional<double> number_of(std::string_view text, std::initializer_list<std::string_view> words, bool last) {
  for (const std::string_view word : words) {
    const std::size_t at = last ? text.rfind(word) : text.find(word);
    if (at != std::string_view::npos) return number_after_name(text, at + word.size() + 1);
  }
  return std::nullopt;
}

/// Do the centre and axes agree with those of WGS 84, to a metre or two?
bool is_geocentric_datum(std::string_view text) {
  constexpr std::array<std::string_view, 10> kNames{"wgs_1984",
                                                    "wgs 84",
                                                    "wgs_84",
                                                    "wgs84",
                                                    "world geodetic system 1984",
                                                    "etrs",
                                                    "european terrestrial reference system",
                                                    "north_american_datum_1983",
                                                    "nad83",
                                                    "gda"};
  return std::any_of(kNames.begin(), kNames.end(),
                     [&](std::string_view name) { return text.find(name) != std::string_view::npos; });
}

std::optional<MapPlane> plane_of_text(std::string_view text) {
  if (text.find("transverse_mercator\"") == std::string_view::npos &&
      text.find("transverse mercator\"") == std::string_view::npos)
    return std::nullopt;
  if (!is_geocentric_datum(text)) return std::nullopt;
  const std::size_t ellipsoid = std::min(text.find("spheroid[\""), text.find("ellipsoid[\""));
  const auto longitude = parameter(text, {"central_meridian", "longitude of natural origin"});
  const auto unit = number_of(text, {"lengthunit[", "unit["}, true);
  if (ellipsoid == std::string_view::npos || !longitude || !unit || !(*unit > 0)) return std::nullopt;
  MapPlane plane;
  const std::size_t name = text.find('"', ellipsoid) + 1;
  const auto half_axis = number_after_name(text, name);
  if (!half_axis) return std::nullopt;
  plane.half_axis = *half_axis;
  const std::size_t comma = text.find(',', text.find(',', text.find('"', name)) + 1);
  if (comma == std::string_view::npos) return std::nullopt;
  if (std::from_chars(text.data() + comma + 1, text.data() + text.size(), plane.inverse_flattening).ec != std::errc())
    return std::nullopt;
  plane.unit = *unit;
  plane.longitude = *longitude;
  plane.latitude = parameter(text, {"latitude_of_origin", "latitude of natural origin"}).value_or(0);
  plane.scale = parameter(text, {"scale_factor", "scale factor at natural origin"}).value_or(1);
  plane.east = parameter(text, {"false_easting", "false easting"}).value_or(0) * plane.unit;
  plane.north = parameter(text, {"false_northing", "false northing"}).value_or(0) * plane.unit;
  const bool sound = plane.half_axis > 6.3e6 && plane.half_axis < 6.4e6 && plane.inverse_flattening > 100 &&
                     std::abs(plane.longitude) <= 360 && std::abs(plane.latitude) < 90 && plane.scale > 0.5 &&
                     plane.scale < 2;
  return sound ? std::optional(plane) : std::nullopt;
}

MapPlane utm(int zone, bool south, double inverse_flattening) {
  MapPlane plane;
  plane.inverse_flattening = inverse_flattening;
  plane.longitude = 6 * zone - 183;
  plane.scale = 0.9996;
  plane.east = 500000;
  plane.north = south ? 10000000 : 0;
  return plane;
}

std::optional<MapPlane> plane_of_number(std::string_view digits) {
  int number = 0;
  const auto [end, bad] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (bad != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  constexpr double kWgs84 = 298.257223563, kGrs80 = 298.257222101;
  const auto zone = [&](int base, int first, int last) { return number >= base + first && number <= base + last; };
  if (zone(32600, 1, 60)) return utm(number - 32600, false, kWgs84);
  if (zone(32700, 1, 60)) return utm(number - 32700, true, kWgs84);
  if (zone(25800, 28, 38)) return utm(number - 25800, false, kGrs80);
  if (zone(26900, 1, 23)) return utm(number - 26900, false, kGrs80);
  return std::nullopt;
}

}  // namespace

std::optional<MapPlane> map_plane(const std::string& crs) {
  constexpr std::string_view kEpsg = "epsg:";
  const std::string text = lower_case(crs);
  if (text.starts_with(kEpsg)) return plane_of_number(std::string_view(text).substr(kEpsg.size()));
  for (const char* word : {"projcs[", "projcrs[", "projectedcrs["}) {
    if (const std::size_t at = text.find(word); at != std::string::npos) return plane_of_text(bracketed(text, at));
  }
  return std::nullopt;
}

std::array<double, 2> to_degrees(const MapPlane& plane, double x, double y) {
  const Krueger series(plane.half_axis, plane.inverse_flattening);
  const double length = series.radius * plane.scale;
  const double xi = (y * plane.unit - plane.north) / length + meridian(series, plane.latitude);
  const double eta = (x * plane.unit - plane.east) / length;
  double up = xi, right = eta;
  for (std::size_t j = 0; j < series.back.size(); ++j) {
    const double turns = 2 * (static_cast<double>(j) + 1);
    up -= series.back[j] * std::sin(turns * xi) * std::cosh(turns * eta);
    right -= series.back[j] * std::cos(turns * xi) * std::sinh(turns * eta);
  }
  // The latitude whose image on the sphere this is: each step is exact to 1/150 of the one before.
  const double image = std::atanh(std::sin(up) / std::cosh(right));
  double sine = std::tanh(image);
  constexpr int kSteps = 10;
  for (int i = 0; i < kSteps; ++i)
    sine = std::tanh(image + series.eccentricity * std::atanh(series.eccentricity * sine));
  return {plane.longitude + std::atan2(std::sinh(right), std::cos(up)) / kRadian, std::asin(sine) / kRadian};
}

Vec3 geocentric(const MapPlane& plane, double longitude, double latitude, double height) {
  const double f = 1 / plane.inverse_flattening, e2 = f * (2 - f);
  const double l = longitude * kRadian, b = latitude * kRadian;
  const double curve = plane.half_axis / std::sqrt(1 - e2 * std::sin(b) * std::sin(b));
  return {(curve + height) * std::cos(b) * std::cos(l), (curve + height) * std::cos(b) * std::sin(l),
          (curve * (1 - e2) + height) * std::sin(b)};
}

Matrix4 to_earth(const MapPlane& plane, const Vec3& origin) {
  const auto earth = [&](double x, double y, double z) {
    const auto [longitude, latitude] = to_degrees(plane, origin[0] + x, origin[1] + y);
    return geocentric(plane, longitude, latitude, (origin[2] + z) * plane.unit);
  };
  const double reach = 100 / plane.unit;  // metres either way: the projection's bend is far below rounding
  const auto column = [&](double x, double y, double z) {
    return (0.5 / reach) * (earth(x, y, z) - earth(-x, -y, -z));
  };
  const Vec3 east = column(reach, 0, 0), north = column(0, reach, 0), up = column(0, 0, reach), at = earth(0, 0, 0);
  return {east[0], east[1], east[2], 0, north[0], north[1], north[2], 0,
          up[0],   up[1],   up[2],   0, at[0],    at[1],    at[2],    1};
}

}  // namespace lamina::tiles
