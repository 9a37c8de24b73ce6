#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "isosurface/extract.h"

namespace lamina {
namespace {

/// One corner of a triangle at a vertex that may have several fans.
struct Use {
  std::uint32_t vertex = 0;
  SlabIndex* slot = nullptr;          ///< to be re-indexed
  std::array<std::uint64_t, 2> ends;  ///< the other two vertices, named across the slabs
  int side = 0;  ///< of the vertex's edge, along the axis after its own: where the triangle lies, + or -
};

/// The slab has surface on two opposite sides of the edge and none between: two fans.
bool is_bow_tie(const IsoVertex& v) {
  return v.open == 0b0101 || v.open == 0b1010;
}

/// A slab and those beside it, null where there is none.
struct SlabStack {
  const IsoSlab *below, *here, *above;

  /// The slab whose table an index leads into, seen from `from`: -1 the one below, 0, 1 the one above.
  static int level(int from, SlabIndex i) { return from + (i.next() ? 1 : 0); }
  [[nodiscard]] const IsoSlab* at(int level) const {
    return level < 0 ? below : level == 0 ? here : level == 1 ? above : nullptr;
  }

  /// On which side of the bow tie's edge another vertex of one of its triangles lies; 0: on neither, or unknown.
  [[nodiscard]] int side(const IsoVertex& tie, int from, SlabIndex other) const {
    const int owner = level(from, other);
    if (at(owner) == nullptr) return 0;
    const IsoVertex& v = at(owner)->vertices[other.index()];
    const IsoSlab* const corners = at(level(owner, v.low));
    if (corners == nullptr) return 0;
    const int u = (tie.axis + 1) % 3;
    const std::int32_t away = corners->corners[v.low.index()].position[u] - here->corners[tie.low.index()].position[u];
    if (away == 0) return v.axis == u ? 1 : 0;
    return away > 0 ? 1 : -1;
  }
};

/// Uses of the stack's middle slab's vertices in the triangles of slab `from`, 0 or -1.
void collect(const SlabStack& stack, int from, std::vector<IsoTriangle>& triangles, std::vector<Use>& uses) {
  const auto name = [&](SlabIndex i) {
    return static_cast<std::uint64_t>(SlabStack::level(from, i) + 1) << 40 | i.index();
  };
  for (IsoTriangle& t : triangles) {
    for (int i = 0; i < 3; ++i) {
      if (SlabStack::level(from, t[i]) != 0) continue;
      const IsoVertex& tie = stack.here->vertices[t[i].index()];
      if (!is_bow_tie(tie)) continue;
      const SlabIndex a = t[(i + 1) % 3], b = t[(i + 2) % 3];
      uses.push_back({t[i].index(), &t[i], {name(a), name(b)}, stack.side(tie, from, a) + stack.side(tie, from, b)});
    }
  }
}

/// Fan of each use of one vertex: triangles that share an edge there are of the same.
std::vector<std::size_t> fans(const Use* uses, std::size_t count) {
  std::vector<std::size_t> fan(count);
  std::iota(fan.begin(), fan.end(), std::size_t{0});
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (uses[i].ends[0] != uses[j].ends[1] && uses[i].ends[1] != uses[j].ends[0]) continue;
      const std::size_t from = std::max(fan[i], fan[j]);
      const std::size_t to = std::min(fan[i], fan[j]);
      std::replace(fan.begin(), fan.end(), from, to);
    }
  }
  return fan;
}

/// How far the vertices of two fans stand apart, as a share of their edge: less than kEdgeMargin, so that both are on
/// it.
constexpr float kFanStep = 0.004F;

/// Moves a vertex towards the nearer end of its edge, whose cluster it is of as well. The fans of a vertex lie in cells
/// across the edge from each other, and their triangles lead away from it: nothing folds.
void step_aside(IsoVertex& vertex) {
  vertex.t += vertex.near_high ? kFanStep : -kFanStep;
}

}  // namespace

void separate_fans(IsoSlab* below, IsoSlab& slab, const IsoSlab* above, ExtractCounts& counts) {
  if (std::none_of(slab.vertices.begin(), slab.vertices.end(), is_bow_tie)) return;
  std::vector<Use> uses;
  const SlabStack stack{below, &slab, above};
  if (below != nullptr) collect(stack, -1, below->triangles, uses);
  collect(stack, 0, slab.triangles, uses);
  std::stable_sort(uses.begin(), uses.end(), [](const Use& a, const Use& b) { return a.vertex < b.vertex; });
  for (std::size_t first = 0, last = 0; first < uses.size(); first = last) {
    while (last < uses.size() && uses[last].vertex == uses[first].vertex) ++last;
    const std::vector<std::size_t> fan = fans(&uses[first], last - first);
    for (std::size_t f = 1; f < fan.size(); ++f) {
      if (std::find(fan.begin(), fan.end(), f) == fan.end()) continue;
      const std::uint32_t vertex = uses[first].vertex;
      const auto copy = static_cast<std::uint32_t>(slab.vertices.size());
      slab.vertices.push_back(IsoVertex(slab.vertices[vertex]));
      int side = 0;
      for (std::size_t i = 0; i < fan.size(); ++i) {
        if (fan[i] != f) continue;
        uses[first + i].slot->bits = copy | (uses[first + i].slot->bits & SlabIndex::kNextSlab);
        side += uses[first + i].side;
      }
      // Which of them steps aside does not depend on the order of the triangles.
      step_aside(slab.vertices[side >= 0 ? copy : vertex]);
      ++counts.separated_vertices;
    }
  }
}

}  // namespace lamina
