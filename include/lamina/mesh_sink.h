// The streamed mesh file: vertices go straight to the output behind a reserved header, faces to a temporary file
// appended at the end; the output appears under its name only when complete.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lamina/attributes.h"

namespace lamina {

/// Vertices in the input's coordinates, parallel arrays.
struct VertexBatch {
  std::vector<double> x, y, z;
  std::vector<float> nx, ny, nz;
  std::vector<std::vector<float>> attributes;
  [[nodiscard]] std::size_t size() const { return x.size(); }
};

struct MeshSinkSettings {
  std::string path;               ///< final name; "-" is standard output
  std::string tmp_dir;            ///< for the face file; empty: next to the output
  AttributeLayout attributes;     ///< written after the normals in their own types
  bool double_positions = false;  ///< `property double x` where float would lose precision
  std::vector<std::string> comments;
};

/// Binary little-endian PLY. Bytes depend on the appended data alone, not on how it was split into batches.
class MeshSink {
 public:
  /// Creates the files. Throws Error(budget) naming path and reason when the output's folder cannot be written,
  /// or the path is a directory.
  explicit MeshSink(MeshSinkSettings settings);
  ~MeshSink();  ///< without commit(): removes everything it made
  MeshSink(const MeshSink&) = delete;
  MeshSink& operator=(const MeshSink&) = delete;
  void append_vertices(const VertexBatch& batch);
  /// Vertex indices are global (order of append_vertices). More than 2^31 - 1 vertices need uint indices (up to 2^32 -
  /// 1).
  void append_triangles(const std::vector<std::array<std::uint32_t, 3>>& triangles);
  [[nodiscard]] std::uint64_t vertices() const;
  [[nodiscard]] std::uint64_t triangles() const;
  /// Fills in the header, appends the faces, renames to the final name. Throws Error(budget) on disk full.
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lamina
