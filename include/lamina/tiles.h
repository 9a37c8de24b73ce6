// Meshes as 3D Tiles: a tree of levels of detail that viewers load piece by piece.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

struct TileSettings {
  std::string folder;    ///< to be made, or there and empty; empty: no tiles are asked for
  bool compress = true;  ///< contents by EXT_meshopt_compression
  std::string crs;       ///< of the coordinates (PointSourceInfo::crs); empty: none is known
};

struct TileStats {
  std::uint64_t tiles = 0, leaves = 0;
  int levels = 0;               ///< 1: a single tile
  std::uint64_t triangles = 0;  ///< of all leaves
  std::uint64_t bytes = 0;      ///< of all contents
  double error = 0;             ///< of the coarsest tile, in units of the mesh
  bool on_earth = false;        ///< the root's transform goes to the Earth (ECEF)
};

/// Writes the mesh as 3D Tiles 1.1: FOLDER/tileset.json and one GLB a tile. Leaves have all triangles of the mesh, some
/// 30,000 to 60,000 each, in the cells of an octree; every other tile is what its children are together, simplified to
/// as many, and replaces them from afar. Vertices between two tiles stay as they are in every tile below the one that
/// holds both, so that tiles of any levels meet without cracks. Positions are whole steps of one lattice. The folder
/// appears when it is complete; the same bytes for any number of threads. Throws Error(budget) for a folder that is not
/// empty or cannot be written, Error(unreadable) for a mesh without triangles or with coordinates that are not finite,
/// Error(internal) when cancelled.
TileStats write_tiles(const TriangleMesh& mesh, const TileSettings& settings, const RunContext& run = {});

/// The same of a mesh file that need not fit in memory: a binary PLY of triangles, as this program writes them, with
/// normals. Nothing for any other file, which is to be read whole. Throws Error(unreadable) for a damaged one.
std::optional<TileStats> write_tiles_of_file(const std::string& path, const TileSettings& settings,
                                             const RunContext& run = {});

/// The coordinate reference system that a PLY names in a comment (PointSourceInfo::crs); empty where it names none, and
/// for other files.
std::string crs_of_mesh(const std::string& path);

}  // namespace lamina
