// The range grid of Stanford's range images: a PLY element with a list for each place, empty or with its vertex.
#pragma once
#include <memory>

#include "points/input_file.h"
#include "points/ply_header.h"
#include "points/scan_grid.h"

namespace lamina {

/// Null where the file has none, or one that cannot be used: its vertices are not those of the file in their order, or
/// the header does not tell its width (obj_info num_cols). Elements are as the header promises, or end the walk.
std::shared_ptr<const ScanGrid> read_range_grid(const InputFile& file, const PlyHeader& header);

}  // namespace lamina
