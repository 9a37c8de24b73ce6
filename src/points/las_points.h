// LAS, uncompressed: random access from any thread.
#pragma once
#include <memory>
#include <string>

#include "lamina/points.h"
#include "points/input_file.h"

namespace lamina {

/// Attributes: intensity, red green blue and nir where any point has them other than 0, and extra bytes of one value.
/// Colours that never exceed 255 are 8-bit ones in 16 bits, which some programs write, and come as such.
std::unique_ptr<PointSource> open_las(InputFile file, const std::string& path);

}  // namespace lamina
