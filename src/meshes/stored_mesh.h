// A finished mesh that lies in files as the records of a streamed PLY, on its way to another format.
#pragma once
#include <cstdint>

#include "lamina/run.h"
#include "meshes/mesh_sink.h"

namespace lamina {

/// Where the records of streamed_ply.h begin, vertices and faces each in one piece.
struct StoredMesh {
  int vertex_file = -1;
  std::uint64_t vertex_offset = 0;
  int face_file = -1;
  std::uint64_t face_offset = 0;
  std::uint64_t vertices = 0, triangles = 0;
};

/// Writes the mesh in the format of its name, `settings.path`, which is not PLY. Reads it in passes and holds blocks of
/// it, so that memory does not go with its size. The file appears under its name when complete. Throws Error(budget)
/// where it cannot be written, Error(internal) when cancelled.
void write_stored(const StoredMesh& mesh, const MeshSinkSettings& settings, const RunContext& run);

}  // namespace lamina
