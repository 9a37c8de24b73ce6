// A reconstruction's mesh handed over while it is made, instead of being written to a file.
#pragma once
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// What is known of a streamed mesh before its first vertex.
struct StreamedMeshLayout {
  AttributeLayout attributes;
  bool double_positions = false;      ///< a file has its positions as doubles; else as floats
  std::vector<std::string> comments;  ///< a file has them in its header, where it has one
};

/// Whoever takes the mesh. The calls come in order, one at a time, from threads of the run.
class MeshReceiver {
 public:
  MeshReceiver() = default;
  virtual ~MeshReceiver() = default;
  MeshReceiver(const MeshReceiver&) = delete;
  MeshReceiver& operator=(const MeshReceiver&) = delete;
  /// Once, before the first piece.
  virtual void begin(const StreamedMeshLayout& layout) = 0;
  /// The next slab. Its triangles name vertices of this piece and of the pieces before, counted over all of them. The
  /// values are those that a file would hold: positions rounded to float where it has floats, attributes rounded and
  /// clamped to their types.
  virtual void take(TriangleMesh piece) = 0;
};

/// Writes a mesh that a receiver was given: the same bytes as those of the file that the run would have written. With
/// `layout` of the run, whose attributes the mesh has. Throws as write_mesh() does.
void write_mesh(const TriangleMesh& mesh, const StreamedMeshLayout& layout, const std::string& path,
                const RunContext& run = {});

}  // namespace lamina
