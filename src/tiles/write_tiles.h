// A mesh that is read block by block to 3D Tiles, and tileset.json, the tree of tiles.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lamina/run.h"
#include "lamina/tiles.h"
#include "meshes/formats.h"
#include "tiles/georeference.h"
#include "tiles/tile_mesh.h"
#include "tiles/tile_octree.h"

namespace lamina::tiles {

/// What tileset.json says of a tile.
struct TileEntry {
  StepBox box;                  ///< of its own content
  double error = 0;             ///< steps
  std::uint64_t triangles = 0;  ///< 0: there is no such tile
  std::uint64_t bytes = 0;
  std::string content{};  ///< file
};

struct Tileset {
  const TileOctree& octree;
  const std::vector<TileEntry>& entries;  ///< by node
  const TileLattice& lattice;
  std::string crs;
  std::optional<MapPlane> plane;
};

/// 3D Tiles 1.1: an explicit tree, REPLACE; boxes hold the contents of a tile and of all below it. The root's transform
/// goes from the lattice's origin to the Earth where the plane is known, else to the mesh's coordinates.
std::string tileset_json(const Tileset& tileset);

TileStats stats_of(const Tileset& tileset);

/// Triangles of a tile: about as many in a leaf, within bounds in the others.
struct TileSizes {
  double leaf = 45'000, least = 30'000, most = 60'000;
};

/// write_tiles() of a mesh that need not be in memory; it has normals.
TileStats write_blocks_as_tiles(meshes::MeshBlocks& mesh, const TileSettings& settings, const RunContext& run,
                                const TileSizes& sizes = {});

}  // namespace lamina::tiles
