// How large a mesh is: area, volume, edges, curvature, parts.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// A component: triangles connected through shared vertices.
struct MeshPart {
  std::uint64_t triangles = 0;
  double area = 0;
  bool closed = false;  ///< every edge lies in exactly two triangles that run along it in opposite directions
  double volume = 0;    ///< enclosed, negative when the triangles face inwards; 0 unless closed
  std::array<double, 3> low{}, high{};
};

/// Lengths in mesh units. Triangles that name a vertex twice are left out.
struct MeshMeasures {
  std::uint64_t vertices = 0;  ///< in triangles
  std::uint64_t triangles = 0, edges = 0, boundary_edges = 0;
  std::array<double, 3> low{}, high{};  ///< box of the vertices in triangles
  std::array<double, 3> centroid{};     ///< of the surface, by area
  double area = 0;
  double boundary_length = 0;
  std::optional<double> volume;  ///< where every part is closed
  double shortest_edge = 0, mean_edge = 0, longest_edge = 0;
  double total_gaussian_curvature = 0;      ///< angle deficit summed over inner vertices; 4 pi for a sphere
  double mean_absolute_mean_curvature = 0;  ///< by area, from the edges' dihedral angles; 1 / r for a sphere
  std::vector<MeshPart> parts;              ///< largest area first
};

/// Sums run in the order of the mesh: the same bits for any number of threads. Work space about 100 bytes per
/// triangle. Throws Error(unreadable) for a mesh without triangles or with a vertex in one that is not finite.
MeshMeasures measure_mesh(const TriangleMesh& mesh, const RunContext& run = {});

}  // namespace lamina
