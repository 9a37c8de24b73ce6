// The boundary of a mesh: directed edges of one triangle alone and the vertices at their ends, found while the mesh
// streams by (BoundaryFinder), kept as bytes for parts of a mesh and for other processes of the same program, and
// joined to closed loops, whatever the order in which they come (BoundaryPaths).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "meshes/mesh_sink.h"

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
  /// Vertex i and the number of one of another loop, or of none, that are: of two loops, one at least knows.
  std::vector<std::pair<std::uint32_t, Number>> leaving;
};

/// Appends a batch.
void pack(const BoundaryBatch& batch, std::vector<std::byte>& out);

/// Reads all that was packed into one batch. Throws Error(unreadable) where bytes are missing.
BoundaryBatch unpack(std::span<const std::byte> bytes);

/// Takes a mesh slab by slab; triangles name vertices of their slab and of the one before. Keeps the vertices of three
/// slabs and the triangles of two.
///
/// Every vertex sums up, over its triangles, a hash of the next vertex less one of the vertex before: nothing remains
/// where the triangles around it close. So only the few vertices of boundary loops are looked at edge by edge.
class BoundaryFinder {
 public:
  using Triangles = std::vector<std::array<std::uint32_t, 3>>;

  /// Of a whole mesh, whose vertices count from 0.
  BoundaryFinder() = default;
  /// Of a part: triangles name its first vertex `first`, boundary loops name it 0. `below`: the slab that it stands on,
  /// which is of another part.
  BoundaryFinder(std::uint64_t first, const VertexBatch& below);

  /// The next slab; adds to `out` what is known now: the boundary loops of the slab before.
  void add(const VertexBatch& vertices, const Triangles& triangles, BoundaryBatch& out);
  /// No more slabs come. `more`: those of another part follow.
  void finish(bool more, BoundaryBatch& out);

 private:
  struct Slab {
    VertexBatch vertices;
    std::uint64_t first = 0;  ///< number of the first vertex, as triangles name it
    [[nodiscard]] std::uint64_t end() const { return first + vertices.size(); }
  };
  void slide(const VertexBatch& vertices, const Triangles& triangles);
  void count(const Triangles& triangles);
  void settle(bool loose, BoundaryBatch& out);
  void collect(const Triangles& triangles, const Slab& slab);
  [[nodiscard]] bool open(std::uint64_t vertex) const { return turns_[vertex - base_] != 0; }
  [[nodiscard]] std::array<double, 3> position(std::uint64_t vertex) const;
  void put_vertices(const Slab& slab, BoundaryBatch& out) const;

  struct HalfEdge {
    std::uint64_t low = 0, high = 0;
    bool up = false;  ///< runs from low to high
    std::array<std::uint32_t, 3> triangle{};
  };

  std::uint64_t origin_ = 0;          ///< number of the first vertex that is not `below`
  std::array<Slab, 3> slabs_{};       ///< two before, the one before, the last
  Triangles before_, last_;           ///< of the one before and of the last
  std::vector<std::uint64_t> turns_;  ///< of the three slabs' vertices
  std::uint64_t base_ = 0;            ///< vertex of turns_[0]
  bool part_below_ = false;           ///< the slab before is another part's
  std::vector<HalfEdge> found_;
};

/// A boundary loop, or as much of it as is known.
struct LoopExtent {
  std::uint64_t edges = 0;
  double length = 0;  ///< input units
  double radii = 0;   ///< the same in local influence radii
  std::array<double, 3> low{}, high{};
  [[nodiscard]] std::array<double, 3> middle() const {
    return {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])};
  }
};

/// Memory holds the vertices of boundary loops that are open still, and no longer than `longest`: of longer ones only
/// the ends.
class BoundaryPaths {
 public:
  struct Bounds {
    double longest = 0;       ///< radii, about
    std::uint64_t edges = 0;  ///< at most
  };
  /// `closed` gets loops within the bounds, `left` all others in the end. `attributes`: of each vertex.
  BoundaryPaths(const Bounds& bounds, std::size_t attributes, std::function<void(Loop&&, const LoopExtent&)> closed,
                std::function<void(const LoopExtent&)> left);
  /// Lengths are summed up in the order of coming: what is just about too long is for the closer to decide.
  static constexpr double kRoundedUp = 1.001;

  /// `first`: what the batch's numbers count from. Loose edges are not looked at.
  void add(const BoundaryBatch& batch, Number first);
  /// Forgets vertices below `number` that have no edge.
  void forget_below(Number number);
  /// No more edges come; boundary loops that never closed are left.
  void finish();

 private:
  static constexpr Number kNone = std::numeric_limits<Number>::min();
  struct Node {
    BoundaryVertex vertex;
    std::vector<float> attributes;
    std::vector<Number> inner;
    Number next = kNone;  ///< along the boundary loop's edges
    bool entered = false;
    std::array<double, 3> facing{};  ///< of the edge to `next`
  };
  struct Path {
    Number first = 0, last = 0;
    LoopExtent extent;
    bool dropped = false;  ///< only its ends are known
  };
  void join(const BoundaryEdge& edge);
  std::optional<Path> take_ending(Number vertex);
  std::optional<Path> take_beginning(Number vertex);
  void erase_between(Number first, Number last);
  Loop take_loop(const Path& path);

  Bounds bounds_;
  std::size_t attributes_;
  std::function<void(Loop&&, const LoopExtent&)> closed_;
  std::function<void(const LoopExtent&)> left_;
  std::unordered_map<Number, Node> nodes_;
  std::unordered_map<Number, Path> by_first_;  ///< open paths by their first vertex
  std::unordered_map<Number, Number> last_to_first_;
};

}  // namespace lamina::boundary
