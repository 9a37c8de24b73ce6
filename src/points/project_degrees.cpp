// Longitude and latitude to metres in a plane.
#include "points/formats.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "lamina/error.h"
#include "lamina/points.h"
#include "points/transverse_mercator.h"

namespace lamina {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

struct Ellipsoid {
  double half_axis = 6378137;  ///< of WGS 84, metres
  double inverse_flattening = 298.257223563;
};

/// Conformal, true to scale along its middle meridian.
class TransverseMercator {
 public:
  TransverseMercator(const Ellipsoid& ellipsoid, double longitude, double latitude)
      : longitude_(longitude), krueger_(ellipsoid.half_axis, ellipsoid.inverse_flattening) {
    double east = longitude, north = latitude;
    apply(east, north);
    north_ = north;
  }

  /// Longitude and latitude in degrees become metres to the east and north of the origin.
  void apply(double& x, double& y) const {
    const double latitude = y * kRadians;
    const double away = std::remainder(x - longitude_, 360.0) * kRadians;
    const double s = std::sin(latitude);
    const double t = std::sinh(std::atanh(s) - krueger_.eccentricity * std::atanh(krueger_.eccentricity * s));
    const double xi = std::atan2(t, std::cos(away));
    const double eta = std::asinh(std::sin(away) / std::hypot(t, std::cos(away)));
    double east = eta, north = xi;
    for (std::size_t j = 0; j < krueger_.to.size(); ++j) {
      const double turns = 2 * (static_cast<double>(j) + 1);
      east += krueger_.to[j] * std::cos(turns * xi) * std::sinh(turns * eta);
      north += krueger_.to[j] * std::sin(turns * xi) * std::cosh(turns * eta);
    }
    x = krueger_.radius * east;
    y = krueger_.radius * north - north_;
  }

 private:
  double longitude_;
  Krueger krueger_;
  double north_ = 0;  ///< of the origin
};

/// The ellipsoid that well-known text names, of either generation; else that of WGS 84.
Ellipsoid ellipsoid_of(const std::string& crs) {
  for (const char* word : {"SPHEROID[", "ELLIPSOID["}) {
    const std::size_t begin = crs.find(word);
    if (begin == std::string::npos) continue;
    const std::size_t comma = crs.find(',', crs.find('"', crs.find('"', begin) + 1));
    if (comma == std::string::npos) continue;
    Ellipsoid found;
    const char* const end = crs.data() + crs.size();
    const auto [next, bad] = std::from_chars(crs.data() + comma + 1, end, found.half_axis);
    if (bad != std::errc() || next == end || *next != ',') continue;
    if (std::from_chars(next + 1, end, found.inverse_flattening).ec != std::errc()) continue;
    // Of the Earth, in metres.
    if (found.half_axis > 6.3e6 && found.half_axis < 6.4e6 &&
        (found.inverse_flattening == 0 || found.inverse_flattening > 100))
      return found;
  }
  return {};
}

/// The plane in well-known text; empty where the degrees are of a system that cannot be told in it.
std::string plane_text(const std::string& crs, double longitude, double latitude) {
  std::string degrees;
  if (crs.empty() || crs == "EPSG:4326" || crs == "EPSG:4979") {
    degrees =
        "GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],"
        "UNIT[\"degree\",0.0174532925199433]]";
  } else if (const std::size_t begin = crs.find("GEOGCS["); begin != std::string::npos) {
    degrees = bracketed(crs, begin);
  }
  if (degrees.empty()) return {};
  return fmt::format(
      "PROJCS[\"transverse Mercator around {0} {1}\",{2},PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_"
      "origin\",{1}],PARAMETER[\"central_meridian\",{0}],PARAMETER[\"scale_factor\",1],PARAMETER[\"false_easting\",0],"
      "PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]]",
      longitude, latitude, degrees);
}

bool is_on_the_globe(double x, double y) {
  constexpr double kNearPole = 89.9;
  return std::abs(x) <= 360 && std::abs(y) <= kNearPole;
}

/// The first place of a source, to whole degrees, so that neighbouring tiles come into one plane.
struct MiddleOfPlane {
  double longitude = 0, latitude = 0;
};

[[noreturn]] void refuse_place(const PointSourceInfo& info, std::uint64_t row, double x, double y,
                               const std::string& what) {
  throw Error(ExitCode::unreadable,
              fmt::format("{}: row {} is at {} {}, {}; leave --project-degrees away, or such points out (--where)",
                          info.path, row + 1, x, y, what));
}

MiddleOfPlane middle_of(PointSource& source) {
  constexpr std::size_t kRows = 4096;
  SampleBatch batch;
  for (std::uint64_t first = 0; first < source.info().count; first += kRows) {
    source.read(first, kRows, batch);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const double x = batch.x[i], y = batch.y[i];
      if (!std::isfinite(x) || !std::isfinite(y)) continue;
      if (!is_on_the_globe(x, y))
        refuse_place(source.info(), first + i, x, y, "which is no longitude and latitude off the poles");
      return {std::round(x), std::round(y)};
    }
  }
  return {};
}

class ProjectedDegrees final : public PointSource {
 public:
  explicit ProjectedDegrees(std::unique_ptr<PointSource> source)
      : source_(std::move(source)),
        middle_(middle_of(*source_)),
        plane_(ellipsoid_of(source_->info().crs), middle_.longitude, middle_.latitude) {
    info_ = source_->info();
    info_.geographic = false;
    info_.double_precision = true;
    info_.crs = plane_text(info_.crs, middle_.longitude, middle_.latitude);
    info_.remarks.push_back(
        fmt::format("{}: degrees become metres: transverse Mercator around longitude {}, latitude {}{}", info_.path,
                    middle_.longitude, middle_.latitude,
                    info_.crs.empty() ? "; the coordinate reference system is left away" : ""));
    for (ScanPart& scan : info_.scans) {
      if (scan.scanner == ScanPart::Scanner::position || scan.scanner == ScanPart::Scanner::pose_origin)
        plane_.apply(scan.at[0], scan.at[1]);
    }
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    constexpr double kWidest = 6;  // degrees of longitude: half a percent of scale
    source_->read(first, count, out);
    for (std::size_t i = 0; i < out.size(); ++i) {
      double &x = out.x[i], &y = out.y[i];
      if (!std::isfinite(x) || !std::isfinite(y)) continue;
      if (!is_on_the_globe(x, y))
        refuse_place(info_, first + i, x, y, "which is no longitude and latitude off the poles");
      if (std::abs(std::remainder(x - middle_.longitude, 360.0)) > kWidest || std::abs(y - middle_.latitude) > kWidest)
        refuse_place(info_, first + i, x, y,
                     fmt::format("more than {} degrees from {} {}, too far for one plane", kWidest, middle_.longitude,
                                 middle_.latitude));
      plane_.apply(x, y);
    }
  }

 private:
  std::unique_ptr<PointSource> source_;
  MiddleOfPlane middle_;
  TransverseMercator plane_;
};

}  // namespace

bool names_degrees(const std::string& crs) {
  if (crs == "EPSG:4326" || crs == "EPSG:4979") return true;
  const auto has = [&](const char* word) { return crs.find(word) != std::string::npos; };
  // Projected systems contain a geographic one.
  if (has("PROJCS[") || has("PROJCRS[") || has("PROJECTEDCRS[") || has("Cartesian")) return false;
  return has("GEOGCS[") || has("GEOGCRS[") || has("GEODCRS[") || has("GEOGRAPHICCRS[");
}

std::unique_ptr<PointSource> project_degrees(std::unique_ptr<PointSource> source) {
  const PointSourceInfo& info = source->info();
  if (!info.geographic && !info.crs.empty()) {
    throw Error(ExitCode::usage, fmt::format("{}: x and y are no degrees, but coordinates of {}; leave "
                                             "--project-degrees away",
                                             info.path, crs_name(info.crs)));
  }
  return std::make_unique<ProjectedDegrees>(std::move(source));
}

void require_no_degrees(const PointSourceInfo& info) {
  if (!info.geographic) return;
  throw Error(
      ExitCode::unreadable,
      fmt::format("{}: x and y are degrees of longitude and latitude, in which no distance can be measured; "
                  "--project-degrees takes them to metres in a plane, other programs to a system of your choice",
                  info.path == "-" ? "standard input" : info.path));
}

std::string crs_name(const std::string& crs) {
  // The name is the first text in quotes; that of a compound system tells both of its parts.
  const std::size_t open = crs.find('"');
  if (open == std::string::npos) return crs;
  const std::size_t close = std::min(crs.find('"', open + 1), crs.size());
  return crs.substr(open + 1, close - open - 1);
}

}  // namespace lamina
