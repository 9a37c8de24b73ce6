// Points to text: XYZ with blanks, CSV with commas, both below a line of names.
#pragma once
#include <memory>
#include <string>

#include "lamina/points_writer.h"

namespace lamina {

/// Numbers have as many digits as their type needs to come back the same. As open_points_writer() describes.
std::unique_ptr<PointsWriter> open_xyz_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);
std::unique_ptr<PointsWriter> open_csv_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

}  // namespace lamina
