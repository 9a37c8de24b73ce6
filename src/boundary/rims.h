// Rims cut where the samples end. The field they are cut by is made to pass its level before the surface ends, and
// averaged along the surface (RimSmoother); the mesh then ends on the curve where it passes the level (RimTrimmer), as
// a surface trimmed by density does (Kazhdan and Hoppe, "Screened Poisson surface reconstruction", 2013), and not along
// whole triangles.
#pragma once
#include <algorithm>
#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

#include "meshes/fan_hashes.h"
#include "meshes/mesh_slab.h"

namespace lamina {

/// A cut lies at least this share of its edge away from either end, so that no triangle loses its area.
inline constexpr float kLeastCut = 0.05F;

/// Takes a streamed mesh slab by slab and gives back what lies within the level, one slab later, in the order in which
/// it came: of every slab the vertices that stay, then those of its cuts by the edge they lie on. A manifold stays one.
/// What comes out of a slab depends on it and on the slabs on either side alone.
class RimTrimmer {
 public:
  /// `level`: > 0, of VertexBatch::overhang, which vertices that are pushed must have.
  explicit RimTrimmer(float level) : level_(level) {}

  void push(MeshSlab slab);
  void finish();  ///< no more slabs come
  /// The next trimmed slab, false when none is ready. Its vertices have no overhang. What `out` held is gone, its
  /// storage used again.
  bool pop(MeshSlab& out);
  /// Storage of a slab that has gone, for one to be pushed.
  MeshSlab spare() { return std::exchange(spare_, {}); }

 private:
  using Edge = std::pair<std::uint32_t, std::uint32_t>;  ///< lower number first
  struct Held {
    MeshSlab mesh;
    std::uint32_t first = 0;            ///< number of its first vertex as it came
    std::uint32_t trimmed_first = 0;    ///< and as it goes
    std::vector<std::uint32_t> number;  ///< of each vertex that stays, from trimmed_first
    std::vector<Edge> cuts;             ///< ascending
    std::uint32_t kept = 0;             ///< vertices that stay
    bool rim = false;                   ///< not all of them do
    /// A slab without a rim, upon one without, goes as it came: what is left of it are its overhangs.
    [[nodiscard]] std::uint32_t end() const {
      return first + static_cast<std::uint32_t>(mesh.vertices.overhang.size());
    }
  };

  void trim(const Held* below, Held& here, const Held* above, MeshSlab& out);
  void pass(const Held* below, Held& here, bool stays, MeshSlab& out);
  void find_cuts(const Held* below, Held& here, const Held* above) const;
  void add_cut_vertices(const Held* below, const Held& here, VertexBatch& out) const;
  void cut_triangles(const Held* below, const Held& here, MeshSlab& out) const;

  float level_;
  std::deque<Held> held_;  ///< at most the slab below the next one to trim, that one, and the one above
  bool below_ = false;     ///< the first one held is trimmed
  bool finished_ = false;
  std::uint32_t pushed_ = 0, trimmed_ = 0;  ///< vertices
  MeshSlab spare_;
};

/// The overhang that vertices on the boundary have at least, levels of the cut: more than one, so that the mesh is cut
/// through its last row of triangles, not left with it, where the surface ends before the level is reached.
inline constexpr float kEndOverhang = 1.25F;

/// Takes a streamed mesh slab by slab and gives it back, two slabs later. Overhangs on the boundary are raised to
/// kEndOverhang, but not where a vertex has no neighbour inside: narrow bridges stay. Then every vertex's
/// moves half of the way to the mean of its neighbours' along the edges (an edge with two triangles counts twice).
/// Slabs far from any boundary and any overhang of the level pass as they are. What comes out of a slab depends on it,
/// on the two above and on the one below (for whose boundary the triangles of this one count) alone, and not on the
/// order of triangles.
class RimSmoother {
 public:
  /// `level`: of the cut, > 0.
  explicit RimSmoother(float level) : level_(level) {}

  void push(MeshSlab slab);
  void finish();  ///< no more slabs come
  /// The next slab, false when none is ready.
  bool pop(MeshSlab& out);

 private:
  struct Held {
    MeshSlab mesh;
    std::uint32_t first = 0;             ///< number of its first vertex
    FanHashes fans;                      ///< while triangles come
    std::vector<float> overhang;         ///< as it came
    std::vector<std::uint8_t> boundary;  ///< 1: a vertex on the boundary
    std::vector<std::uint32_t> raised;   ///< overhangs, those on the boundary raised, in whole units
    bool rim = false;                    ///< vertices on the boundary, or overhangs of the level or more
    [[nodiscard]] std::uint32_t end() const { return first + static_cast<std::uint32_t>(overhang.size()); }
  };
  void find_boundary(Held& here) const;
  void smooth(Held& here, const Held* below, const Held* above);
  /// A vertex's overhang, where it is on the boundary raised.
  [[nodiscard]] float raised(const Held& of, std::size_t i) const {
    return of.boundary[i] != 0 ? std::max(of.overhang[i], kEndOverhang * level_) : of.overhang[i];
  }
  /// Of a vertex's neighbours, each as often as it has triangles with it.
  struct Around {
    std::uint64_t sum = 0;                     ///< of their overhangs, in units
    std::uint32_t neighbours = 0, inside = 0;  ///< all of them, and those not on the boundary
  };

  float level_;
  std::deque<Held> held_;  ///< the one before the next to go, that one, and those above
  bool below_ = false;     ///< the first one held has gone
  bool finished_ = false;
  std::uint32_t pushed_ = 0;  ///< vertices
  std::vector<Around> around_;
};

}  // namespace lamina
