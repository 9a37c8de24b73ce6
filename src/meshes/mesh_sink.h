// The streamed mesh file: vertices go straight to the output behind a reserved header, faces to a temporary file
// appended at the end; the output appears under its name only when complete. Further files, and formats other than PLY,
// are written from these two files when they are.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/run.h"
#include "meshes/formats.h"

namespace lamina::meshes {
class MeshBlocks;
}

namespace lamina {

/// Vertices in the input's coordinates, parallel arrays.
struct VertexBatch {
  std::vector<double> x, y, z;
  std::vector<float> nx, ny, nz;
  std::vector<std::vector<float>> attributes;
  std::vector<float> radius;    ///< local influence radius R; empty where it is of no interest; never written
  std::vector<float> density;   ///< samples, 1 / input unit^2, 0 where unknown; empty likewise; never written
  std::vector<float> overhang;  ///< by how much of R they reach beyond the samples; empty likewise; never written
  /// The fit's normals, which say how the surface goes on beyond a rim, where nx, ny, nz are others; empty where these
  /// are the fit's; never written.
  std::vector<std::array<float, 3>> fitted;
  [[nodiscard]] std::size_t size() const { return x.size(); }
  [[nodiscard]] std::array<float, 3> fitted_normal(std::size_t i) const {
    return fitted.empty() ? std::array<float, 3>{nx[i], ny[i], nz[i]} : fitted[i];
  }
};

struct MeshSinkSettings {
  /// Final name; "-" is standard output; links are followed, pipes and devices written to. Its ending says the format:
  /// .obj, .off, .stl and .glb are meant, every other name is a PLY's.
  std::string path{};
  std::vector<std::string> more_paths{};  ///< the same mesh once more, each in the format of its own name
  std::string tmp_dir{};          ///< for the face file; empty: next to the output (standard output: the system's)
  AttributeLayout attributes{};   ///< written after the normals in their own types; integers are rounded and clamped
  bool double_positions = false;  ///< `property double x` where float would lose precision
  std::vector<std::string> comments{};  ///< one header line each, beside the signature
  meshes::GlbLimits glb{};

  /// All names, in their order.
  [[nodiscard]] std::vector<std::string> paths() const;
};

/// Binary little-endian PLY: x y z nx ny nz and the attributes per vertex, `list uchar int vertex_indices` per face.
/// Bytes depend on the appended data alone, not on how it was split into batches. Keeps half a megabyte, whatever the
/// size. One thread at a time. After an error only destruction is left.
///
/// Until commit() the vertices lie in a hidden file beside the output (.NAME.partial-PID), the faces in an unnamed one.
class MeshSink {
 public:
  /// Creates the files. Throws Error(budget) naming path and reason when an output's folder is missing or cannot be
  /// written, the path is a directory or a file that may not be replaced; Error(usage) when standard output is a
  /// terminal; Error(internal) for attribute names a PLY cannot hold.
  explicit MeshSink(MeshSinkSettings settings);
  ~MeshSink();  ///< without commit(): removes everything it made
  MeshSink(const MeshSink&) = delete;
  MeshSink& operator=(const MeshSink&) = delete;
  /// Throws Error(internal) naming the vertex when a number is not finite (or too large for its float property) or the
  /// arrays differ in length, Error(budget) naming path and reason when the disk is full.
  void append_vertices(const VertexBatch& batch);
  /// Vertex indices are global (order of append_vertices) and may run ahead of the vertices appended so far; commit()
  /// throws Error(internal) when one of them never came. Errors as append_vertices.
  void append_triangles(const std::vector<std::array<std::uint32_t, 3>>& triangles);
  [[nodiscard]] std::uint64_t vertices() const;
  [[nodiscard]] std::uint64_t triangles() const;
  [[nodiscard]] const std::string& tmp_dir() const;  ///< where its temporary files lie
  /// Gives what has been appended to `use`, to be read back. Throws what that throws, and as commit().
  void read_back(const std::function<void(meshes::MeshBlocks&)>& use, const RunContext& run = {});
  /// Fills in the header (`uint` indices where more than 2^31 - 1 vertices need them; up to 2^32 - 1), appends the
  /// faces, renames to the final name; in another format than PLY, which has its own limits, writes the file anew
  /// (see write_files()). Throws Error(budget) on disk full, Error(internal) when cancelled; the name of an output that
  /// could not be written is untouched then.
  void commit(const RunContext& run = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Vertices [first, first + count) of a mesh that has normals.
void take_vertices(const TriangleMesh& mesh, std::size_t first, std::size_t count, VertexBatch& out);
/// A mesh, or a piece whose triangles count vertices from the sink's first. It has normals and the sink's attributes.
void append_mesh(const TriangleMesh& mesh, MeshSink& sink);

/// The comment every sink writes first: "made by lamina VERSION".
std::string sink_signature();

/// The version of the lamina that wrote a PLY file, from its signature; nothing for files of other programs.
/// Throws Error(unreadable) when the file cannot be opened.
std::optional<std::string> read_sink_signature(const std::string& path);

// The bytes of a streamed mesh, a binary little-endian PLY: a header whose length is known before its counts, vertices
// and faces.

/// Throws Error(internal) when a name is empty, has blanks, or is there twice (x y z nx ny nz are taken).
void require_ply_names(const AttributeLayout& attributes);

/// Bytes to keep free for mesh_header() whatever the counts.
std::size_t mesh_header_bytes(const MeshSinkSettings& settings);

/// The header, padded by a comment to mesh_header_bytes(). Line breaks in comments become blanks.
std::string mesh_header(const MeshSinkSettings& settings, std::uint64_t vertices, std::uint64_t triangles);

/// Bytes of a vertex: positions (float or double), normal, attributes in their own types.
std::size_t vertex_record_bytes(const AttributeLayout& attributes, bool double_positions);

/// Bytes of a triangle: the list's length and three indices.
constexpr std::size_t kFaceRecordBytes = 1 + 3 * sizeof(std::uint32_t);

/// Throws Error(internal) when an array is not as long as the batch, or a number is not finite in the type it is
/// written as; `first` is the number of the batch's first vertex, for the message.
void require_writable(const VertexBatch& batch, const AttributeLayout& attributes, bool double_positions,
                      std::uint64_t first);

/// Writes vertices [first, first + count) of a batch that is writable.
void encode_vertices(const VertexBatch& batch, const AttributeLayout& attributes, bool double_positions,
                     std::size_t first, std::size_t count, std::byte* out);

/// Writes `count` faces; returns their largest vertex index (0 for none).
std::uint32_t encode_faces(const std::array<std::uint32_t, 3>* triangles, std::size_t count, std::byte* out);

}  // namespace lamina
