// Ascii PLY: one row a line, read in order.
#pragma once
#include <memory>

#include "points/input_file.h"
#include "points/ply_header.h"
#include "points/ply_rows.h"

namespace lamina {

/// Refuses counts the file is too small for, whatever its rows look like. Throws Error(unreadable).
std::unique_ptr<PointSource> open_ascii_ply(InputFile file, const PlyHeader& header, PlyRows rows);

}  // namespace lamina
