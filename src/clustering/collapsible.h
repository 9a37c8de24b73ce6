// The exact local test: may one connected component of a cluster collapse to a point without changing the topology?
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace lamina::clustering {

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

}  // namespace lamina::clustering
