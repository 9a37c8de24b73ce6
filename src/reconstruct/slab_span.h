// Which slabs of the finished surface a run is to give, and from which slab on its stages must work for that.
#pragma once
#include <algorithm>
#include <cstdint>

#include "lattice/lattice.h"
#include "store/ingest.h"

namespace lamina {

/// Slabs [begin, end).
struct SlabSpan {
  std::int32_t begin = 0, end = 0;
  [[nodiscard]] bool empty() const { return begin >= end; }
  bool operator==(const SlabSpan&) const = default;
};

/// Slabs a cell can be touched from: three cells of the coarsest level, each a slab high.
inline constexpr std::int32_t kReachSlabs = 3;

/// All slabs that can hold surface, and one that holds the upper corners of their cells.
inline SlabSpan all_slabs(const Lattice& lattice, const Extent& extent) {
  return {lattice.slab_of(extent.z_min) - kReachSlabs, lattice.slab_of(extent.z_max) + kReachSlabs + 2};
}

/// The slabs each stage works on so that the finished slabs of a span, and the numbers of those just below it, are the
/// ones of a sweep through all slabs. Each line follows from the one above; docs/scaling.md says why.
struct StageSpans {
  SlabSpan marked;   ///< all samples of these slabs, with their own levels
  SlabSpan refined;  ///< cells: three cells reach three slabs
  SlabSpan placed;   ///< corners: of the cells of the slab below, too
  SlabSpan projected;
  SlabSpan finished;      ///< signs: by the values around, a slab either way
  SlabSpan numbered;      ///< isovertices: of the slab above only the first plane counts
  SlabSpan triangulated;  ///< whose fans are separate: the slab below is triangulated, too
};

/// `diffuse`: corners follow the centres of the slab below.
inline StageSpans stage_spans(const SlabSpan& span, const SlabSpan& all, bool diffuse) {
  const auto grown = [&](std::int32_t below, std::int32_t above) {
    return SlabSpan{std::max(all.begin, span.begin - below), std::min(all.end, span.end + above)};
  };
  return {grown(9, 8), grown(6, 5), grown(5, 5), grown(diffuse ? 6 : 5, 5), grown(4, 4), grown(4, 4), grown(4, 3)};
}

}  // namespace lamina
