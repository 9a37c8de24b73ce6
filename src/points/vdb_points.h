// OpenVDB points grids as a source of rows.
#pragma once
#include <memory>
#include <string>

#include "lamina/points.h"

namespace lamina {

/// The file's first points grid, whole in memory: OpenVDB reads no parts of one. Attributes of types without numbers
/// are named in a remark. Throws Error(unreadable).
std::unique_ptr<PointSource> open_vdb(const std::string& path);

}  // namespace lamina
