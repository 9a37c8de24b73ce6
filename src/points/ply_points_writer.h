// Points to binary little-endian PLY.
#pragma once
#include <memory>
#include <string>

#include "lamina/points_writer.h"

namespace lamina {

/// The header for `count` rows, padded by a comment to the same length whatever the count.
std::string ply_points_header(const PointColumns& columns, const std::vector<std::string>& comments,
                              std::uint64_t count);

/// As open_points_writer() describes.
std::unique_ptr<PointsWriter> open_ply_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

}  // namespace lamina
