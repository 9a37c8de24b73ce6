// Binary PLY, both byte orders: random access from any thread.
#pragma once
#include <memory>

#include "points/input_file.h"
#include "points/ply_header.h"
#include "points/ply_rows.h"

namespace lamina {

/// Checks the file against its header (see locate_element). Throws Error(unreadable).
std::unique_ptr<PointSource> open_binary_ply(InputFile file, const PlyHeader& header, PlyRows rows);

}  // namespace lamina
