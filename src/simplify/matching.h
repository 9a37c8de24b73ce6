// Edges of a mesh contracted in passes: in each the cheapest edges that have no vertex in common. A queue of all edges
// (Contractor) orders them better and takes several times as long; the error is larger by a few percent. So parts of a
// larger mesh are simplified by themselves, such that they still fit the others.
#pragma once
#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "meshes/vec3.h"
#include "simplify/quadric.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// What is interpolated where two vertices become one.
struct Carried {
  std::vector<std::array<float, 3>> normals;  ///< or none
  std::vector<std::vector<float>> values;     ///< of each attribute
};

/// Triangles to be thinned out where the surface is flat, with what their vertices stand for.
struct ThinPart {
  std::vector<Triangle> triangles;
  std::vector<StandIn> vertices;
  std::vector<float> budgets;        ///< what contracting the vertices may cost, summed up as their quadrics are
  std::vector<std::uint8_t> locked;  ///< vertices that stay as they are; at open sides they have to
  Carried carried;
  std::vector<std::vector<float>> low, high;  ///< range of each attribute over what a vertex stands for
};

/// Works on a whole mesh in one thread, block by block of its triangles, which lie near each other in a mesh that was
/// streamed or merged of such. Keeps its memory for the next mesh.
class Matching {
 public:
  struct Result {
    std::uint64_t triangles = 0;  ///< left
    /// Of all contractions the largest root mean square distance of a new vertex from the planes.
    double deviation = 0;
  };
  /// Contracts until `wanted` triangles are left, or only few edges can go. Vertices whose `locked` is not 0 stay as
  /// they are, and so do those of edges with more than two triangles, or with two that face opposite sides. Vertices
  /// that have gone stay in the arrays. Throws Error(internal) when cancelled.
  Result reduce(TriangleMesh& mesh, std::span<const std::uint8_t> locked, std::uint64_t wanted, const RunContext& run);
  /// Contracts what costs no more than its budget, unless an attribute's range would exceed its tolerance. Throws as
  /// reduce().
  Result thin(ThinPart& part, std::span<const float> tolerances, const RunContext& run);

 private:
  struct Edge {
    std::uint32_t u, v;
  };
  /// Whether triangles run along an edge, either way: the vertex at its other end, if they do.
  struct Ways {
    std::uint32_t out = kNone, in = kNone;
  };

  void begin(std::vector<Triangle>&& triangles, std::span<const std::uint8_t> locked);
  void survey_rings();
  void add_planes();
  void survey_ring(std::uint32_t vertex);
  void add_wall(std::uint32_t from, std::uint32_t to, std::uint32_t beside);
  void begin_pass();
  void end_pass();
  void gather(std::size_t begin, std::size_t end, std::size_t step);
  template <class Limit>
  void price(const Limit& dearest);
  [[nodiscard]] float limit(double share);
  void pass(float dearest, std::uint64_t wanted);
  void thin_pass(ThinPart& part, std::span<const float> tolerances);
  bool contract(std::uint32_t u, std::uint32_t v, float dearest);
  void interpolate(std::uint32_t u, std::uint32_t v, double share);
  /// Calls use(u, v), u < v, for those of edges_ of which no end is held, the cheapest first.
  template <class Use>
  void take_cheapest(const Use& use);

  std::vector<StandIn> vertices_;
  Carried carried_;
  std::vector<std::uint8_t> states_;  ///< of the vertices: bits of State
  Stars stars_;
  std::uint64_t size_ = 0;  ///< triangles
  std::uint64_t free_ = 0;  ///< vertices that are there and not locked
  double deviation2_ = 0;
  double sliver_ = kSliver;

  std::vector<Ways> ways_;    ///< of edges to the vertex that is looked at
  std::vector<Edge> edges_;   ///< of a block
  std::vector<float> costs_;  ///< theirs
  std::vector<Edge> queue_;   ///< the cheapest first
};

/// Vertices whose `stays` is 0 leave the arrays; triangles are not looked at.
void keep_vertices(TriangleMesh& mesh, std::span<const std::uint8_t> stays);

/// Vertices without triangles go; the others keep their order. Returns the new number of each, kNone of those that
/// went.
std::vector<std::uint32_t> drop_unused(TriangleMesh& mesh);

struct PartResult {
  double deviation = 0;  ///< largest root mean square distance of a new vertex from the planes it stands for
  std::vector<std::uint32_t> numbers;  ///< drop_unused()
};

/// Simplifies one part after the other, side by side in several threads, each of which keeps its memory.
class PartSimplifier {
 public:
  /// Contracts edges until `triangles` are left, or only a few can go (Matching). Vertices whose `locked` is not 0 keep
  /// place, normal, attributes and the edges between them, so that borders with other parts stay as they are. The mesh
  /// need not be manifold. Depends on the mesh alone. Throws Error(internal) when cancelled.
  PartResult simplify(TriangleMesh& mesh, std::span<const std::uint8_t> locked, std::uint64_t triangles,
                      const RunContext& run);

 private:
  tbb::enumerable_thread_specific<Matching> matchings_;
};

}  // namespace lamina::simplify
