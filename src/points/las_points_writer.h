// Points to LAS 1.4.
#pragma once
#include <memory>
#include <string>

#include "lamina/points_writer.h"

namespace lamina {

/// Point format 6, or 7 where there are colours, which then have 16 bits (8-bit ones times 257, floats of 0-1 times
/// 65535). An integer `intensity` of at most 16 bits has its own place; normals, radius, quality and all else are extra
/// bytes under their names. Coordinates become integers of 32 bits with steps of a power of ten, the smallest that
/// spans the points, so rows wait in an unnamed file until commit(). As open_points_writer() describes otherwise;
/// throws Error(internal) also for names longer than 32 characters.
std::unique_ptr<PointsWriter> open_las_points_writer(const std::string& path, const PointColumns& columns,
                                                     const PointsWriterSettings& settings);

}  // namespace lamina
