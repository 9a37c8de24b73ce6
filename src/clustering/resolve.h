// The unresolved clusters, one by one: components, vetoes to their neighbours, and the exact test.
#pragma once
#include "clustering/collapsible.h"
#include "clustering/record.h"

namespace lamina::clustering {

/// Storage reused from cluster to cluster; one per thread.
struct ResolveScratch {
  std::vector<Ref> members;
  std::vector<std::uint32_t> parent;
  std::vector<std::uint64_t> steps;
  std::vector<StarTriangle> all, star;
  ComponentScratch component;
};

/// Splits the cluster into components connected through its edges; they are numbered by their smallest isovertex.
void split_components(Window& window, const SlabRecord& record, UnresolvedCluster& cluster, ResolveScratch& scratch);

/// Condition Q for the accepted neighbours: vetoes each one on whose ring a vertex of this cluster begins two steps.
/// Safe from several threads.
void veto_neighbours(Window& window, const SlabRecord& record, const UnresolvedCluster& cluster,
                     ResolveScratch& scratch);

/// Tests each component exactly and places it if its corner holds others. Needs the components of all unresolved
/// clusters of the slab below, this one and the next.
Verdict resolve(const Window& window, const SlabRecord& record, UnresolvedCluster& cluster, ResolveScratch& scratch);

}  // namespace lamina::clustering
