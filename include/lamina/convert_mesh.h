// A mesh file into another format, piece by piece.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "lamina/run.h"

namespace lamina {

struct ConvertedMesh {
  std::uint64_t vertices = 0, triangles = 0;
};

/// Writes a mesh file that need not fit in memory as OBJ, OFF, STL or GLB: what write_mesh() writes of it, byte for
/// byte. Of a binary PLY of triangles with normals, as this program writes them, whose positions are all finite;
/// nothing, and nothing written, for all others, which are to be read whole. Throws what write_mesh() throws,
/// Error(internal) when cancelled.
std::optional<ConvertedMesh> convert_mesh_file(const std::string& from, const std::string& to,
                                               const RunContext& run = {});

}  // namespace lamina
