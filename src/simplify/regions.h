// A mesh too large for memory, region by region: where it is cut, and its parts on disk between the rounds of a
// simplification.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/spill_file.h"
#include "lamina/mesh.h"
#include "lamina/run.h"
#include "meshes/formats.h"
#include "meshes/vec3.h"
#include "simplify/cut.h"
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

/// Every triangle is in one region. Vertices that triangles of several regions have, or might have, are locked.
class Regions {
 public:
  Regions() = default;
  virtual ~Regions() = default;
  Regions(const Regions&) = delete;
  Regions& operator=(const Regions&) = delete;
  [[nodiscard]] virtual std::uint32_t count() const = 0;
  /// Vertices stand in the order of their ids. May be without triangles.
  [[nodiscard]] virtual RegionMesh load(std::uint32_t region) = 0;
};

/// A mesh as it lies in its file, without quadrics. Sorts the triangles by region into a temporary file, with a buffer
/// for each, and reads vertices where they lie: triangles had better name vertices near those of the ones before, as
/// they do in streamed meshes. Throws Error(unreadable) for triangles that name vertices that are not there, or one
/// twice, Error(budget) for a full disk, Error(internal) when cancelled. Refers to all that it is given.
std::unique_ptr<Regions> regions_of_mesh(meshes::MeshBlocks& mesh, BoxTree tree, const std::string& tmp_dir,
                                         const RunContext& run);

/// Parts that a round has left, put together anew by `tree`. `to`: an empty file like `from`, which is not needed any
/// more afterwards.
std::unique_ptr<Regions> regions_of_parts(const RegionFile& from, const std::vector<RegionFile::Place>& parts,
                                          BoxTree tree, std::unique_ptr<RegionFile> to, const RunContext& run);

}  // namespace lamina::simplify
