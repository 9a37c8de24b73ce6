// Measures of triangle meshes: whether a mesh is manifold, oriented and closed (check_mesh), how large it is and how it
// is curved (measure_mesh), and how far it lies from another surface (compare).
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// What a mesh is, in exact counts. Edges, fans and the Euler characteristic leave out triangles that name a vertex
/// twice.
struct CheckReport {
  std::uint64_t vertices = 0, triangles = 0, edges = 0;

  std::uint64_t non_finite_vertices = 0;    ///< a coordinate is NaN or infinite
  std::uint64_t unreferenced_vertices = 0;  ///< in no triangle
  std::uint64_t duplicate_vertices = 0;     ///< at the exact position of an earlier vertex

  std::uint64_t non_manifold_edges = 0;     ///< in more than two triangles
  std::uint64_t non_manifold_vertices = 0;  ///< with more than one fan of triangles joined through shared edges
  std::uint64_t inconsistent_edges = 0;     ///< whose two triangles run along them in the same direction

  std::uint64_t repeated_index_triangles = 0;  ///< name a vertex twice
  std::uint64_t zero_area_triangles = 0;       ///< others whose height is below 1e-12 of the longest side
  std::uint64_t duplicate_triangles = 0;       ///< the same three vertices as an earlier one, in any order

  std::uint64_t boundary_edges = 0;  ///< in one triangle only
  std::uint64_t boundary_loops = 0;  ///< connected runs of boundary edges; closed curves where the mesh is manifold
  std::uint64_t longest_loop_edges = 0;
  double longest_loop_length = 0;  ///< mesh units, of the loop with most edges (the longer of equals)

  std::uint64_t components = 0;  ///< sets of triangles connected through shared vertices
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

/// Checks a mesh in time linear in its size, with about 60 bytes of work space per triangle. Vertices need not be
/// finite. Throws Error(unreadable) when the mesh has no triangles, or more than 1,431,655,765.
CheckReport check_mesh(const TriangleMesh& mesh, const RunContext& run = {});

/// A component: triangles connected through shared vertices.
struct MeshPart {
  std::uint64_t triangles = 0;
  double area = 0;
  bool closed = false;  ///< every edge lies in exactly two triangles, which run along it in opposite directions
  double volume = 0;    ///< enclosed; negative when the triangles face inwards, 0 unless closed
  std::array<double, 3> low{}, high{};
};

/// The size of a mesh; lengths in mesh units. Triangles that name a vertex twice are left out.
struct MeshMeasures {
  std::uint64_t vertices = 0;  ///< in triangles
  std::uint64_t triangles = 0, edges = 0, boundary_edges = 0;
  std::array<double, 3> low{}, high{};  ///< box of the vertices in triangles
  std::array<double, 3> centroid{};     ///< of the surface, by area
  double area = 0;
  double boundary_length = 0;
  std::optional<double> volume;  ///< sum over the parts, where every part is closed
  double shortest_edge = 0, mean_edge = 0, longest_edge = 0;
  double total_gaussian_curvature = 0;      ///< angle deficit summed over inner vertices; 4 pi for a sphere
  double mean_absolute_mean_curvature = 0;  ///< by area, from the edges' dihedral angles; 1 / r for a sphere
  std::vector<MeshPart> parts;              ///< largest area first
};

/// Measures a mesh: areas, volumes by tetrahedra, Gaussian curvature by angle deficits, mean curvature by dihedral
/// angles (Cohen-Steiner and Morvan 2003). Sums run in the order of the mesh: the same bits for any number of threads.
/// About 100 bytes of work space per triangle. Throws Error(unreadable) for a mesh without triangles, with more than
/// 1,431,655,765 or with a triangle's vertex that is not finite, and Error(internal) when cancelled.
MeshMeasures measure_mesh(const TriangleMesh& mesh, const RunContext& run = {});

struct CompareSettings {
  std::uint64_t count = 1'000'000;  ///< samples per side, > 0: uniform by area, stratified
  std::uint64_t seed = 1;
  bool vertices =
      false;  ///< sample each side at the vertices of its triangles instead: the error of the vertices alone
};

/// Distances from the samples of one surface to the other surface, input units.
struct DistanceStats {
  std::uint64_t samples = 0;
  double rms = 0, mean = 0, p99 = 0, max = 0;  ///< p99: 99 % of the samples lie no farther than this
};

struct CompareResult {
  std::optional<DistanceStats> a_to_b;  ///< samples of A to the triangles of B; empty when B has no triangles
  std::optional<DistanceStats> b_to_a;  ///< the other way round
  double diagonal =
      0;  ///< of the box of B's triangles (of its points where it has none): relative figures divide by it
};

/// Compares a mesh A with the truth B in both directions, as Metro does (Cignoni, Rocchini and Scopigno 1998): samples
/// of one side, their exact distances to the triangles of the other. A side without triangles is a point cloud: its
/// points are the samples, and nothing is measured towards it. A triangle without area counts as the segment or point
/// that it is. The result is the same bits for any number of threads. Throws Error(usage) when count is 0,
/// Error(unreadable) when neither side has triangles or a sampled side has no area.
CompareResult compare(const TriangleMesh& a, const TriangleMesh& b, const CompareSettings& settings,
                      const RunContext& run = {});

}  // namespace lamina
