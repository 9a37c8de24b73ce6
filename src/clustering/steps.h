// The steps of a slab in the clusterer, in their order: it is laid out and counted, its clusters are decided while most
// pass a fast test on their sums and the rest the exact one, and at last its vertices get their numbers and its
// triangles leave.
#pragma once
#include "clustering/record.h"

namespace lamina::clustering {

/// Fills a fresh record for `iso`: the cluster of each vertex and the slot of each corner.
/// Throws Error(internal) where an index leaves this slab's corners.
void lay_out(SlabRecord& record, std::shared_ptr<const IsoSlab> iso);

/// Counts the triangles of `slab` into the notes of `slab` and the next one, and lists its border triangles.
/// Throws Error(internal) where an index leaves the tables of the two slabs.
void count_triangles(Window& window, std::int64_t slab, ClusterMode mode);

/// Once `slab` and the one below are counted: accepts the clusters of `slab` whose sums prove them safe, gathers the
/// triangles of all others (the unresolved ones), splits these into components, and vetoes accepted neighbours (of the
/// slab below, this one and the next) that would meet one of their vertices twice. The record of slab + 1 must be laid
/// out.
void classify(Window& window, std::int64_t slab);

/// Once `slab` + 1 is classified: final verdicts for all clusters of `slab`.
void decide(Window& window, std::int64_t slab);

/// The shape of a cluster with at most one member per direction, read from a few bits. For a cluster away from
/// boundaries: true when
/// - its induced complex is contractible (condition C), and
/// - no neighbour that fulfils C and R can fail Q because of it. That would need a vertex x met twice on the
///   neighbour's ring; between the two visits the ring walks through members whose triangles all lie in the two
///   clusters, and as the complex is contractible, removing x cuts these off as a component of idle members only.
///   Without such an x: true.
bool plain_shape(const CornerNote& note);

/// Once the clusters of `slab` and the next one are decided: numbers the final vertices of `slab` from `next_number`
/// on, and writes them with the surviving triangles: the border triangles of the slab below, then the others of this
/// slab. Throws Error(budget) when the numbers run out.
void number(Window& window, std::int64_t slab, std::uint64_t& next_number, FinalSlab& out, ClusterCounts& counts);

}  // namespace lamina::clustering
