// The boundary loops of a mesh: directed edges of one triangle alone, and the vertices at their ends.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lamina::boundary {

/// A vertex of the mesh by its number: in the mesh, or from a part's first vertex on (negative: of the slab before).
using Number = std::int64_t;

struct BoundaryVertex {
  Number number = 0;
  std::array<double, 3> position{};
  std::array<float, 3> normal{};
  float radius = 0;  ///< local influence radius R, input units
};

/// As the triangle runs along it. `normal`: of the triangle, not normalised.
struct BoundaryEdge {
  Number from = 0, to = 0;
  std::array<double, 3> normal{};
};

/// An edge of two triangles.
struct InnerEdge {
  Number a = 0, b = 0;
};

/// What is known of the boundary loops of some slabs. Vertices are listed before, or together with, the edges they
/// belong to.
struct BoundaryBatch {
  std::vector<BoundaryVertex> vertices;
  std::vector<float> attributes;    ///< vertex after vertex, as many of each as the mesh has
  std::vector<InnerEdge> inner;     ///< those of which both ends may lie on a boundary loop
  std::vector<BoundaryEdge> edges;  ///< of boundary loops
  std::vector<BoundaryEdge>
      loose;  ///< of a part: boundary loops, unless the part before or after has the other triangle
  void clear() {
    vertices.clear();
    attributes.clear();
    inner.clear();
    edges.clear();
    loose.clear();
  }
  [[nodiscard]] bool empty() const { return vertices.empty() && edges.empty() && loose.empty(); }
};

/// A closed boundary loop. Vertex i and the next are joined by an edge of the mesh, `facing[i]` its triangle's normal;
/// the order is that of a filling, against the triangles around.
struct Loop {
  std::vector<BoundaryVertex> vertices;
  std::vector<float> attributes;  ///< as BoundaryBatch
  std::vector<std::array<double, 3>> facing;
  std::vector<std::array<std::uint32_t, 2>> taken;  ///< other pairs (i < j) that are joined by an edge of the mesh
};

/// Appends a batch.
void pack(const BoundaryBatch& batch, std::vector<std::byte>& out);

/// Reads all that was packed into one batch. Throws Error(unreadable) where bytes are missing.
BoundaryBatch unpack(std::span<const std::byte> bytes);

}  // namespace lamina::boundary
