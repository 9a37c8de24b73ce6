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

}  // namespace lamina::clustering
