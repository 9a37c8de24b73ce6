// A mesh too large for memory, region by region.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "lamina/run.h"
#include "meshes/writers.h"
#include "simplify/region_file.h"
#include "simplify/region_tree.h"

namespace lamina::simplify {

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
std::unique_ptr<Regions> regions_of_mesh(meshes::MeshBlocks& mesh, RegionTree tree, const std::string& tmp_dir,
                                         const RunContext& run);

/// Parts that a round has left, put together anew by `tree`. `to`: an empty file like `from`, which is not needed any
/// more afterwards.
std::unique_ptr<Regions> regions_of_parts(const RegionFile& from, const std::vector<RegionFile::Place>& parts,
                                          RegionTree tree, std::unique_ptr<RegionFile> to, const RunContext& run);

}  // namespace lamina::simplify
