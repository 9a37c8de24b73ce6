// A mesh in memory simplified in rounds: cut into pieces that fit the processor's cache, each worked on by itself, and
// cut elsewhere in the next round.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "measure/edge_table.h"
#include "simplify/contractor.h"

namespace lamina::simplify {

/// A manifold mesh with what its vertices stand for.
struct WorkMesh {
  TriangleMesh& mesh;
  std::vector<Quadric> quadrics;
  meshes::Vec3 centre{};
  bool floats = false;                 ///< all positions are
  double bound = 0;                    ///< how far the mesh may get from what it was; 0: as far as it likes
  std::vector<Errors> errors{};        ///< of the triangles; empty without a bound
  std::vector<std::uint8_t> locked{};  ///< vertices that stay where they are, for good; empty: none
  double deviation = 0;                ///< largest of all contractions (Contractor::deviation())
};

/// Sums up planes of triangles and boundary edges. `edges`: of the mesh.
WorkMesh make_work_mesh(TriangleMesh& mesh, const measure::EdgeTable& edges);

/// Contracts edges until `wanted` triangles are left, or no edge can go. Returns the number of contractions. Vertices
/// that have gone stay in the arrays. Throws Error(internal) when cancelled.
std::uint64_t contract_to(WorkMesh& work, std::uint64_t wanted, const RunContext& run);

/// The same as far as the bound allows.
std::uint64_t contract_within(WorkMesh& work, const RunContext& run);

}  // namespace lamina::simplify
