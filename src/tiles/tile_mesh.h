// The mesh of one tile while the tree is built.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "meshes/vec3.h"
#include "simplify/part.h"

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

}  // namespace lamina::tiles
