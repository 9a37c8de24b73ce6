// PLY of any encoding.
#pragma once
#include <memory>
#include <string>

#include "lamina/points.h"
#include "points/input_file.h"

namespace lamina {

/// Throws Error(unreadable).
std::unique_ptr<PointSource> open_ply(InputFile file, const std::string& path);

}  // namespace lamina
