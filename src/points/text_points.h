// XYZ, PTS, ASC, CSV, PWN and whatever else has a point's numbers on a line.
#pragma once
#include <memory>
#include <string>

#include "lamina/points.h"
#include "points/input_file.h"

namespace lamina {

/// Counts the rows; `columns` as in PointSettings. Throws Error(unreadable) or Error(usage).
std::unique_ptr<PointSource> open_text(InputFile file, const std::string& path, const std::string& columns);

}  // namespace lamina
