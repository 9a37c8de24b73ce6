// A mesh that is read block by block to 3D Tiles.
#pragma once
#include "lamina/run.h"
#include "lamina/tiles.h"
#include "meshes/writers.h"

namespace lamina::tiles {

/// write_tiles() of a mesh that need not be in memory; it has normals.
TileStats write_blocks_as_tiles(meshes::MeshBlocks& mesh, const TileSettings& settings, const RunContext& run);

}  // namespace lamina::tiles
