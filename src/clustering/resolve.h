// The unresolved clusters, one by one: components, vetoes to their neighbours, the exact test, and where the vertex of
// a collapsed component goes when its corner holds several: a quadric collapse (Lindstrom 2000).
#pragma once
#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "clustering/steps.h"

namespace lamina::clustering {

// The exact local test: may one connected component of a cluster collapse to a point without changing the topology?

/// A triangle that touches the component. A label names a component of any cluster; equal labels, same component.
struct StarTriangle {
  std::array<std::uint32_t, 3> vertex;
  std::array<std::uint64_t, 3> label;
};

/// Storage reused between calls.
struct ComponentScratch {
  std::vector<std::uint64_t> inner_edges, outer_edges, labels;
  std::vector<std::uint32_t> members, outside;
};

/// Let K be the vertices labelled `own`, connected through edges between them, and `star` all triangles that touch K,
/// part of an oriented 2-manifold with boundary. True when all of these hold:
/// - C: the complex induced by K is contractible (V - E + F = 1);
/// - R: the neighbouring components, met in turn around K with repeats merged, form a simple cycle of at least three,
/// or,
///   where the mesh's boundary passes through K exactly once, a simple path of at least two;
/// - Q: no vertex is met twice around K.
/// Any set of such components may collapse at once: the preimage of every point is then contractible, so the result is
/// homeomorphic to the input.
bool collapses(std::span<const StarTriangle> star, std::uint64_t own, ComponentScratch& scratch);

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

/// A triangle that touches the component, points relative to the component's corner in steps.
struct PatchTriangle {
  std::array<Eigen::Vector3d, 3> point;
  std::array<std::uint32_t, 3> vertex;  ///< names; equal names, same vertex
  std::array<bool, 3> member{};         ///< the vertex belongs to the component
};

/// The point that minimises the summed squared distances to the triangles' planes, weighted by squared area (Lindstrom,
/// "Out-of-core simplification of large polygonal models", SIGGRAPH 2000), sought from the mean of the component's
/// vertices by SVD with small singular values dropped, then held within half the patch's box around that mean.
/// The mean itself where the patch has no area. Depends on the order of `triangles` by rounding only.
Eigen::Vector3d place_patch(std::span<const PatchTriangle> triangles);

}  // namespace lamina::clustering
