// A mesh that is read block by block to 3D Tiles.
#pragma once
#include "lamina/run.h"
#include "lamina/tiles.h"
#include "meshes/writers.h"

namespace lamina::tiles {

/// Triangles of a tile: about as many in a leaf, within bounds in the others.
struct TileSizes {
  double leaf = 45'000, least = 30'000, most = 60'000;
};

/// write_tiles() of a mesh that need not be in memory; it has normals.
TileStats write_blocks_as_tiles(meshes::MeshBlocks& mesh, const TileSettings& settings, const RunContext& run,
                                const TileSizes& sizes = {});

}  // namespace lamina::tiles
