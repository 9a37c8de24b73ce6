#include <algorithm>
#include <numeric>

#include "isosurface/extract.h"

namespace lamina {
namespace {

/// One corner of a triangle at a vertex that may have several fans.
struct Use {
  std::uint32_t vertex = 0;
  SlabIndex* slot = nullptr;          ///< to be re-indexed
  std::array<std::uint64_t, 2> ends;  ///< the other two vertices, named across both slabs
};

/// The slab has surface on two opposite sides of the edge and none between: two fans.
bool is_bow_tie(const IsoVertex& v) {
  return v.open == 0b0101 || v.open == 0b1010;
}

void collect(IsoSlab& owner, std::vector<IsoTriangle>& triangles, bool from_below, std::vector<Use>& uses) {
  const auto name = [&](SlabIndex i) {
    const bool in_below = from_below && !i.next();
    const bool above = !from_below && i.next();
    return (in_below ? std::uint64_t{1} << 40 : above ? std::uint64_t{1} << 41 : 0) | i.index();
  };
  for (IsoTriangle& t : triangles) {
    for (int i = 0; i < 3; ++i) {
      if (t[i].next() != from_below || !is_bow_tie(owner.vertices[t[i].index()])) continue;
      uses.push_back({t[i].index(), &t[i], {name(t[(i + 1) % 3]), name(t[(i + 2) % 3])}});
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

}  // namespace

void separate_fans(IsoSlab* below, IsoSlab& slab, ExtractCounts& counts) {
  if (std::none_of(slab.vertices.begin(), slab.vertices.end(), is_bow_tie)) return;
  std::vector<Use> uses;
  if (below != nullptr) collect(slab, below->triangles, true, uses);
  collect(slab, slab.triangles, false, uses);
  std::stable_sort(uses.begin(), uses.end(), [](const Use& a, const Use& b) { return a.vertex < b.vertex; });
  for (std::size_t first = 0, last = 0; first < uses.size(); first = last) {
    while (last < uses.size() && uses[last].vertex == uses[first].vertex) ++last;
    const std::vector<std::size_t> fan = fans(&uses[first], last - first);
    for (std::size_t f = 1; f < fan.size(); ++f) {
      if (std::find(fan.begin(), fan.end(), f) == fan.end()) continue;
      const auto copy = static_cast<std::uint32_t>(slab.vertices.size());
      slab.vertices.push_back(slab.vertices[uses[first].vertex]);
      for (std::size_t i = 0; i < fan.size(); ++i) {
        if (fan[i] == f) uses[first + i].slot->bits = copy | (uses[first + i].slot->bits & SlabIndex::kNextSlab);
      }
      ++counts.separated_vertices;
    }
  }
}

}  // namespace lamina
