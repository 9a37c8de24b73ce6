// A mesh whose edges are contracted, with what its vertices and triangles stand for.
#pragma once
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"
#include "measure/edge_table.h"
#include "meshes/vec3.h"
#include "simplify/old_mesh.h"
#include "simplify/quadric.h"

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
  std::vector<std::uint8_t> tried{};   ///< with a bound: vertices whose edges could not go in a round before
  double deviation = 0;                ///< largest of all contractions (Contractor::deviation())
};

/// Quadrics are 0, about the middle of the mesh's box.
WorkMesh begin_work_mesh(TriangleMesh& mesh);
/// Sums up planes of triangles.
void add_planes(WorkMesh& work);
/// And those through boundary edges; edges between locked vertices are taken for borders with other meshes. `edges`: of
/// the mesh.
void add_walls(WorkMesh& work, const measure::EdgeTable& edges);
/// All of it.
WorkMesh make_work_mesh(TriangleMesh& mesh, const measure::EdgeTable& edges);

}  // namespace lamina::simplify
