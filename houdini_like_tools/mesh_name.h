// Names of meshes that are written as they come into being.
#pragma once
#include <string>

namespace lamina::tools {

/// A mesh that streams into its file is PLY, whatever the name says. Throws Error(usage) for names that promise another
/// format ("mesh.obj", "mesh.ply.gz"), with the way to it; names that promise nothing ("-", "out", "mesh.tmp") will do.
void require_ply_name(const std::string& output);

}  // namespace lamina::tools
