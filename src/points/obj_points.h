// The vertices of an OBJ file as points.
#pragma once
#include <memory>
#include <string>

#include "lamina/points.h"
#include "points/input_file.h"

namespace lamina {

/// `v x y z [w | r g b | r g b a]`, and `vn` where there are as many of them and the faces, if any, give every vertex
/// its own. Throws Error(unreadable).
std::unique_ptr<PointSource> open_obj(InputFile file, const std::string& path);

}  // namespace lamina
