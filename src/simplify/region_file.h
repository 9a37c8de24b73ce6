// Parts of a mesh on disk, between the rounds of a simplification.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/spill_file.h"
#include "lamina/mesh.h"
#include "simplify/old_mesh.h"
#include "simplify/quadric.h"

namespace lamina::simplify {

/// Triangles of a mesh with their vertices, which other parts may have as well.
struct RegionMesh {
  TriangleMesh mesh;
  std::vector<std::uint32_t> ids;      ///< of the vertices, in the whole mesh
  std::vector<Quadric> quadrics;       ///< of the vertices, about their places; the quadrics of all copies add up
  std::vector<Errors> errors;          ///< of the triangles; empty without a bound
  std::vector<std::uint8_t> tried{};   ///< WorkMesh::tried; empty without a bound
  std::vector<std::uint8_t> locked{};  ///< vertices that other regions have or may have; not written
};

/// Written from its beginning to its end; temporary.
class RegionFile {
 public:
  struct Place {
    std::uint64_t offset = 0;
    std::size_t vertices = 0, triangles = 0;
  };
  /// `layout`: a mesh with the attributes of all that come, and normals if they have them; what else it has does not
  /// matter.
  RegionFile(const std::string& tmp_dir, const TriangleMesh& layout, bool bound);
  /// Throws Error(budget) for a full disk. Its quadrics have to be there.
  Place append(const RegionMesh& part);
  void flush() { file_.flush(); }
  /// Of a flushed file. Throws Error(budget) when it cannot be read.
  [[nodiscard]] RegionMesh read(const Place& place) const;
  [[nodiscard]] std::uint64_t size() const { return file_.size(); }

 private:
  SpillFile file_;
  AttributeLayout attributes_;
  bool normals_, bound_;
};

}  // namespace lamina::simplify
