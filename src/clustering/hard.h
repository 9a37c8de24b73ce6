// The hard clusters, one by one: components, vetoes to their neighbours, and the exact test.
#pragma once
#include "clustering/collapsible.h"
#include "clustering/record.h"

namespace lamina::cluster {

/// Storage reused from cluster to cluster; one per thread.
struct HardScratch {
  std::vector<Ref> members;
  std::vector<std::uint32_t> parent;
  std::vector<std::uint64_t> steps;
  std::vector<StarTriangle> all, star;
  PieceScratch piece;
};

/// Splits the cluster into components connected through its edges; they are numbered by their smallest isovertex.
void split_pieces(Window& window, const SlabRecord& record, HardCluster& hard, HardScratch& scratch);

/// Condition Q for the accepted neighbours: vetoes each one on whose ring a vertex of this cluster begins two steps.
/// Safe from several threads.
void veto_neighbours(Window& window, const SlabRecord& record, const HardCluster& hard, HardScratch& scratch);

/// Tests each component exactly and places it if its corner holds others. Needs the components of all hard clusters of
/// the slab below, this one and the next.
Verdict judge(const Window& window, const SlabRecord& record, HardCluster& hard, HardScratch& scratch);

}  // namespace lamina::cluster
