// PTX (Leica Cyclone's text format): organised scans, each with its pose.
#pragma once
#include <memory>
#include <string>

#include "lamina/points.h"
#include "points/input_file.h"

namespace lamina {

/// Points of all scans in the common frame; places of the grid without a return (0 0 0) are left out. Values after
/// x y z: intensity, and red green blue of 8 bits. Throws Error(unreadable).
std::unique_ptr<PointSource> open_ptx(InputFile file, const std::string& path);

}  // namespace lamina
