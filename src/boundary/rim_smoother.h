// Smoother rims: the field that they are cut by is made to pass its level before the surface ends, and averaged along
// the surface.
#pragma once
#include <cstdint>
#include <deque>
#include <vector>

#include "boundary/rim_trimmer.h"

namespace lamina {

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
    std::vector<float> overhang;         ///< as it came
    std::vector<std::uint8_t> boundary;  ///< 1: a vertex on the boundary
    bool rim = false;                    ///< vertices on the boundary, or overhangs of the level or more
    [[nodiscard]] std::uint32_t end() const { return first + static_cast<std::uint32_t>(overhang.size()); }
  };
  /// `above`: null for the last slab.
  void find_boundary(Held& here, const Held* above);
  void smooth(Held& here, const Held* below, const Held* above);

  float level_;
  std::deque<Held> held_;  ///< the one before the next to go, that one, and those above
  bool below_ = false;     ///< the first one held has gone
  bool finished_ = false;
  std::uint32_t pushed_ = 0;  ///< vertices
  std::vector<std::uint64_t> sums_;
  std::vector<std::uint32_t> counts_, inside_;
};

}  // namespace lamina
