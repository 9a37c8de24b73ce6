// Points to binary PCD.
#pragma once
#include <memory>
#include <string>

#include "lamina/points_writer.h"

namespace lamina {

/// The columns as PCD's fields: red green blue of 8 bits become one `rgb`, packed the way the Point Cloud Library does.
/// As open_points_writer() describes.
std::unique_ptr<PointsWriter> open_pcd_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

}  // namespace lamina
