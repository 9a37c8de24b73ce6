// Topology-preserving decisions: most clusters pass a fast test on their sums, the rest take the exact one.
#pragma once
#include "clustering/record.h"

namespace lamina::clustering {

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
/// neighbour's
///   ring; between the two visits the ring walks through members whose triangles all lie in the two clusters, and as
///   the complex is contractible, removing x cuts these off as a component of idle members only. Without such an x:
///   true.
bool plain_shape(const CornerNote& note);

}  // namespace lamina::clustering
