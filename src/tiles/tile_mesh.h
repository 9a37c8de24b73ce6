// The mesh of one tile while the tree is built, and where those of the leaves come from.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "meshes/formats.h"
#include "meshes/mesh_blocks.h"
#include "meshes/vec3.h"
#include "simplify/matching.h"
#include "tiles/tile_octree.h"

namespace lamina::tiles {

/// What all positions are whole steps of, so that tiles of all levels agree to the last bit. The step is a power of
/// two, and what any float arithmetic does to whole numbers below 2^23 is exact.
struct TileLattice {
  meshes::Vec3 origin{};
  double step = 1;
  [[nodiscard]] meshes::Vec3 steps(const meshes::Vec3& at) const {
    return {std::nearbyint((at[0] - origin[0]) / step), std::nearbyint((at[1] - origin[1]) / step),
            std::nearbyint((at[2] - origin[2]) / step)};
  }
};

/// A vertex that other tiles have as well.
struct SharedVertex {
  std::uint32_t at = 0;  ///< its number in this tile
  std::uint32_t id = 0;  ///< its number in the whole mesh
  int depth = 0;         ///< of the deepest tile that has all triangles around it below it
};

struct TileMesh {
  TriangleMesh mesh;                 ///< positions in whole steps of the lattice
  std::vector<SharedVertex> shared;  ///< with tiles beside the one this is
  double error = 0;                  ///< steps: how far it may be from the mesh that the leaves have
};

/// The children in one, shared vertices once, those that no tile beside it has free from now on.
TileMesh merge_tiles(std::vector<TileMesh> parts, int depth);

/// Contracts edges until `triangles` are left, but for the shared vertices. Adds the error.
void coarsen_tile(TileMesh& tile, std::uint64_t triangles, simplify::PartSimplifier& simplifier, const RunContext& run);

/// The triangles of a mesh sorted by the leaves of the tree, on disk, and the vertices that several leaves share.
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

// A tile's content: its mesh as a GLB.

/// In steps of the lattice.
struct StepBox {
  meshes::Vec3 low{}, high{};
};

StepBox box_of_tile(const TriangleMesh& mesh);

/// Writes one tile after the other, in the memory of the first.
class TileEncoder {
 public:
  TileEncoder();
  ~TileEncoder();
  TileEncoder(const TileEncoder&) = delete;
  TileEncoder& operator=(const TileEncoder&) = delete;

  /// Binary glTF 2.0 with y up, as 3D Tiles want it: x, z, -y of the lattice. Positions are whole numbers of steps from
  /// the middle of the tile in 16 bits (KHR_mesh_quantization), in floats where these do not do; the node brings them
  /// to units of the mesh from the lattice's origin. Normals in bytes; colours linear, 8 bits in 16, others as floats;
  /// further attributes as _NAME in whole numbers of their own type, or floats to 16 bits of a number. `compress`:
  /// EXT_meshopt_compression. Stays as it is until the next one.
  const std::string& content(const TriangleMesh& mesh, const TileLattice& lattice, bool compress);

 private:
  struct Memory;
  std::unique_ptr<Memory> memory_;
};

}  // namespace lamina::tiles
