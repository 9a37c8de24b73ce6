// The triangles of a mesh sorted by the leaves of the tree, on disk, and the vertices that several leaves share.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "lamina/run.h"
#include "meshes/mesh_pieces.h"
#include "meshes/writers.h"
#include "tiles/tile_mesh.h"
#include "tiles/tile_octree.h"

namespace lamina::tiles {

class TileSource {
 public:
  /// Reads all triangles once. Keeps buffers and what is shared: memory goes with the borders of the leaves. Refers to
  /// all that it is given. Throws Error(internal) when cancelled, Error(budget) for a full disk.
  TileSource(meshes::MeshBlocks& mesh, const TileOctree& octree, const std::string& tmp_dir, const RunContext& run);

  /// Those of one leaf, with their vertices; safe from several threads. May be empty.
  [[nodiscard]] TileMesh leaf(std::uint32_t node, const TileLattice& lattice);
  [[nodiscard]] std::uint64_t triangles() const { return triangles_; }  ///< of all leaves
  [[nodiscard]] std::uint64_t left_out() const { return left_out_; }    ///< that name a vertex twice

 private:
  using Corners = std::array<std::uint32_t, 3>;
  struct Use {
    std::uint32_t vertex, leaf;
    auto operator<=>(const Use&) const = default;
  };

  void read(const RunContext& run);
  void add(const Corners& corners, const std::array<std::uint32_t, 3>& homes);
  void forget_repeated();
  void settle_shared();
  void read_vertices(const std::vector<std::uint32_t>& ids, const TileLattice& lattice, TriangleMesh& out);

  meshes::MeshBlocks& mesh_;
  const TileOctree& octree_;
  meshes::TriangleBins leaves_;  ///< by node
  std::vector<Use> uses_;        ///< of vertices in leaves other than their own
  std::size_t most_uses_ = 1U << 20;
  std::vector<std::pair<std::uint32_t, int>> shared_;  ///< vertices, ascending, with SharedVertex::depth
  std::uint64_t triangles_ = 0, left_out_ = 0;
  std::mutex reading_;  ///< of mesh_
};

}  // namespace lamina::tiles
