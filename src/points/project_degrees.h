// Longitude and latitude to metres in a plane.
#pragma once
#include <memory>
#include <string>

#include "lamina/points.h"

namespace lamina {

/// Whether a coordinate reference system (PointSourceInfo::crs) is known to be one of degrees.
bool names_degrees(const std::string& crs);

/// The same points in metres to the east and north of the whole degrees next to the first of them: transverse Mercator
/// on the ellipsoid that the coordinate system names, else that of WGS 84, true to scale along its middle. Heights
/// stay, and are taken for metres. Throws Error(usage) where the coordinates are known to be no degrees;
/// Error(unreadable) naming the row for what is no longitude and latitude or lies too far away for a plane, here or
/// when it is read.
std::unique_ptr<PointSource> project_degrees(std::unique_ptr<PointSource> source);

}  // namespace lamina
