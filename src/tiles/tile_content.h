// A tile's content: its mesh as a GLB.
#pragma once
#include <array>
#include <memory>
#include <string>

#include "meshes/vec3.h"
#include "tiles/tile_mesh.h"

namespace lamina::tiles {

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
