// PCD: ascii, binary, and binary_compressed, which is unpacked to a temporary file first.
#pragma once
#include <memory>
#include <string>

#include "lamina/points.h"
#include "points/input_file.h"

namespace lamina {

/// Packed colours (rgb, rgba) become red green blue [alpha] of 8 bits. Fields of several values and integers of 64 bits
/// are left out. Throws Error(unreadable), and Error(budget) when `tmp_dir` has no room.
std::unique_ptr<PointSource> open_pcd(InputFile file, const std::string& path, const std::string& tmp_dir);

}  // namespace lamina
