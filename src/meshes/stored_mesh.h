// A finished mesh that lies in files as the records of a streamed PLY, on its way to the files it is meant for.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/descriptor.h"
#include "lamina/run.h"
#include "meshes/formats.h"
#include "meshes/mesh_sink.h"

namespace lamina {

/// Where the records of a streamed mesh (mesh_sink.h) begin, vertices and faces each in one piece.
struct StoredMesh {
  int vertex_file = -1;
  std::uint64_t vertex_offset = 0;
  int face_file = -1;
  std::uint64_t face_offset = 0;
  std::uint64_t vertices = 0, triangles = 0;
};

/// The name for which the records are staged: the first PLY's, which they become in the end, else the first of all, for
/// which they only wait.
const std::string& staging_path(const MeshSinkSettings& settings);

/// Throws Error(budget) naming the first of the other names that cannot be written, Error(usage) as OutputFile does.
void require_outputs(const MeshSinkSettings& settings);

/// The mesh's records, read as they are asked for; refers to all that it is given. Reading throws Error(internal) when
/// cancelled, Error(unreadable) for a face that is no triangle.
std::unique_ptr<meshes::MeshBlocks> stored_blocks(const StoredMesh& mesh, const MeshSinkSettings& settings,
                                                  const RunContext& run);

/// Writes the mesh under each name in its format: in passes over the records, of which blocks are held, so that memory
/// does not go with its size. Where one is a PLY, `publish` makes the staged records it, last. A file appears under its
/// name when it is complete. One that cannot be written does not keep the others from being: then throws what was wrong
/// with the first, Error(budget) as a rule, when the others are there, of which further ones are warned of.
/// Error(internal) when cancelled.
void write_files(const StoredMesh& mesh, const MeshSinkSettings& settings, const std::function<void()>& publish,
                 const RunContext& run);

}  // namespace lamina

namespace lamina::meshes {

/// A PLY file that is the records of a streamed mesh, to be read where they lie.
struct StoredPly {
  Descriptor file;
  MeshSinkSettings layout;  ///< its name, attributes and kind of positions
  StoredMesh mesh;
};

/// A file as MeshSink writes them: binary, little-endian, x y z nx ny nz and further numbers, triangles, and as long as
/// its header says. Nothing for any other file. Throws Error(unreadable) where it cannot be read or its header is
/// damaged.
std::optional<StoredPly> open_stored_ply(const std::string& path);

/// Of a comment `crs ...`; empty where there is none, and for what is no PLY. Throws as above.
std::string crs_of_ply(const std::string& path);

}  // namespace lamina::meshes
