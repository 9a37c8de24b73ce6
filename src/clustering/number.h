// Last step of a slab in the clusterer: its vertices get their numbers, its triangles leave.
#pragma once
#include "clustering/record.h"

namespace lamina::clustering {

/// Once the clusters of `slab` and the next one are decided: numbers the final vertices of `slab` from `next_number`
/// on, and writes them with the surviving triangles: the border triangles of the slab below, then the others of this
/// slab. Throws Error(budget) when the numbers run out.
void number(Window& window, std::int64_t slab, std::uint64_t& next_number, FinalSlab& out, ClusterCounts& counts);

}  // namespace lamina::clustering
