// Outputs whose format does not depend on their names: names that promise another one are refused.
#pragma once
#include <string>

namespace lamina::tools {

// Each throws Error(usage) for a name such as "mesh.obj" where PLY is written, with the way to what was meant. Names
// that promise nothing ("-", "out", "mesh.tmp") will do.

/// Meshes that stream into their files: PLY.
void require_mesh_name(const std::string& output);
/// OpenVDB files.
void require_volume_name(const std::string& output);
/// PNG.
void require_picture_name(const std::string& output);

}  // namespace lamina::tools
