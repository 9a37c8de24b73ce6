// The hard clusters, one by one: components, vetoes to their neighbours, and the exact test.
#pragma once
#include "cluster/record.h"

namespace lamina::cluster {

/// Splits the cluster into components connected through its edges; they are numbered by their smallest isovertex.
void split_pieces(Window& window, const SlabRecord& record, HardCluster& hard);

/// Condition Q for the accepted neighbours: vetoes each one on whose ring a vertex of this cluster begins two steps.
/// Safe from several threads.
void veto_neighbours(Window& window, const SlabRecord& record, const HardCluster& hard);

/// Tests each component exactly and places it if its corner holds others. Needs the components of all hard clusters of
/// the slab below, this one and the next.
Verdict judge(const Window& window, const SlabRecord& record, HardCluster& hard);

}  // namespace lamina::cluster
