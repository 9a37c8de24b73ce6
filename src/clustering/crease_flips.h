// Edges turned where they cut a corner off a sharp edge.
//
// Vertices lie on a crease where it passes their cubes, but two that follow one another on it need not share a side:
// where it clips a cube without a vertex, the side of two triangles may run across it, from one sheet to the other, and
// the mesh has a notch. The other diagonal of these triangles runs along the crease.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "meshes/mesh_slab.h"
#include "meshes/vec3.h"

namespace lamina {

/// Slabs below and above one on which its triangles depend.
inline constexpr int kFlipReach = 2;

/// Takes a streamed mesh slab by slab and gives it back, kFlipReach slabs later: the side of two triangles whose ends
/// lie on different sheets, by their normals, gives way to their other diagonal where that leaves each end with a
/// triangle that lies in its sheet. A manifold stays one, of as many triangles. What comes out does not depend on the
/// order of triangles; those that are new come last.
class CreaseFlips {
 public:
  /// `bend`: cosine between the normals of vertices, from which on these lie on one sheet.
  explicit CreaseFlips(double bend) : bend_(bend) {}

  void push(MeshSlab slab);
  void finish();  ///< no more slabs come
  /// The next slab, false when none is ready.
  bool pop(MeshSlab& out);

 private:
  using Triangle = std::array<std::uint32_t, 3>;
  /// A side of one triangle whose ends lie on different sheets.
  struct BentSide {
    std::uint32_t low, high;  ///< its vertices
    std::uint32_t triangle;   ///< of its slab
    std::uint32_t opposite;   ///< the third vertex
    bool ascending;           ///< the triangle goes from the lower to the higher vertex
    [[nodiscard]] auto edge() const { return std::array{low, high}; }
  };
  struct TriangleAt {
    std::size_t slab;  ///< counted from the first one pushed
    std::uint32_t index;
  };
  /// The side of two triangles, (from, to, left) and (to, from, right), that would give way to (left, right).
  struct Flip {
    std::uint32_t from, to, left, right;
    std::array<TriangleAt, 2> triangles;
    double gain;  ///< how much nearer to the sheets the triangles come, as a cosine
    [[nodiscard]] std::array<std::uint32_t, 2> made() const;
    [[nodiscard]] bool goes_before(const Flip& other) const;
  };
  struct Held {
    MeshSlab mesh;
    std::uint32_t first = 0;             ///< number of its first vertex
    std::vector<BentSide> bent;          ///< by edge; of triangles of this slab
    std::vector<Flip> wanted;            ///< whose later triangle is of this slab
    std::vector<std::uint32_t> dropped;  ///< triangles that give way
    std::vector<Triangle> added;
    bool decided = false;  ///< which of those wanted are made
  };

  [[nodiscard]] Held& at(std::size_t slab) { return held_[slab - gone_]; }
  [[nodiscard]] std::size_t slab_of(std::uint32_t vertex) const;  ///< its place in held_
  [[nodiscard]] static meshes::Vec3 position_in(const Held& held, std::uint32_t vertex);
  [[nodiscard]] static meshes::Vec3 normal_in(const Held& held, std::uint32_t vertex);
  void find_bent(Held& here) const;
  void find_wanted(std::size_t slab);
  void want(const BentSide& one, const BentSide& other, const std::array<std::size_t, 2>& slabs, Held& here) const;
  void decide(std::size_t slab);
  [[nodiscard]] std::vector<const Flip*> first_of_their_triangles(std::size_t slab) const;
  void drop_known_edges(std::size_t slab, std::vector<const Flip*>& flips) const;

  double bend_;
  std::deque<Held> held_;
  std::size_t gone_ = 0;  ///< slabs
  bool finished_ = false;
  std::uint32_t pushed_ = 0;  ///< vertices
};

}  // namespace lamina
