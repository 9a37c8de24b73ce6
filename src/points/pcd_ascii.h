// PCD with a point's values on a line.
#pragma once
#include <memory>

#include "lamina/points.h"
#include "points/input_file.h"
#include "points/pcd_header.h"

namespace lamina {

/// `info` holds path, count and remarks. Throws Error(unreadable).
std::unique_ptr<PointSource> open_ascii_pcd(InputFile file, const PcdHeader& header, PointSourceInfo info);

}  // namespace lamina
