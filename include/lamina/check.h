// What a triangle mesh is: finite, manifold, oriented, closed, and where it is not.
#pragma once
#include <cstdint>
#include <optional>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// Edges, fans and the Euler characteristic leave index-degenerate triangles out. Counts are exact.
struct CheckReport {
  std::uint64_t vertices = 0, triangles = 0, edges = 0;

  std::uint64_t non_finite_vertices = 0;    ///< a coordinate is NaN or infinite
  std::uint64_t unreferenced_vertices = 0;  ///< in no triangle
  std::uint64_t duplicate_vertices = 0;     ///< at the exact position of an earlier vertex

  std::uint64_t non_manifold_edges = 0;     ///< in more than two triangles
  std::uint64_t non_manifold_vertices = 0;  ///< their triangles form more than one fan (joined through shared edges)
  std::uint64_t inconsistent_edges = 0;     ///< of two triangles that both run along it in the same direction

  std::uint64_t repeated_index_triangles = 0;  ///< name a vertex twice
  std::uint64_t zero_area_triangles = 0;       ///< others whose height is below 1e-12 of the longest side
  std::uint64_t duplicate_triangles = 0;       ///< the same three vertices as an earlier one, in any order

  std::uint64_t boundary_edges = 0;  ///< in one triangle only
  std::uint64_t boundary_loops = 0;  ///< connected runs of boundary edges; closed curves where the mesh is manifold
  std::uint64_t longest_loop_edges = 0;
  double longest_loop_length = 0;  ///< world units, of the loop with most edges (the longer of equals)

  std::uint64_t components = 0;  ///< connected through shared vertices
  std::uint64_t largest_component_triangles = 0;
  std::uint64_t largest_component_boundary_edges = 0;

  std::int64_t euler_characteristic = 0;  ///< referenced vertices - edges + triangles
  std::optional<std::int64_t> genus;      ///< sum over components, where closed()

  /// Finite, no non-manifold edge or vertex, consistently oriented, no duplicate or index-degenerate triangle.
  [[nodiscard]] bool manifold() const {
    return non_finite_vertices == 0 && non_manifold_edges == 0 && non_manifold_vertices == 0 &&
           inconsistent_edges == 0 && duplicate_triangles == 0 && repeated_index_triangles == 0;
  }
  /// Manifold and without boundary.
  [[nodiscard]] bool closed() const { return manifold() && boundary_edges == 0; }
};

/// Linear in the size of the mesh, about 60 bytes of work space per triangle. Throws Error(unreadable) when the mesh
/// has no triangles.
CheckReport check_mesh(const TriangleMesh& mesh, const RunContext& run = {});

}  // namespace lamina
