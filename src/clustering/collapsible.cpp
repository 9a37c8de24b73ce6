#include "clustering/collapsible.h"

#include <algorithm>

namespace lamina::clustering {
namespace {

template <class T>
std::size_t distinct(std::vector<T>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values.size();
}

std::uint64_t edge_key(std::uint32_t a, std::uint32_t b) {
  return static_cast<std::uint64_t>(std::min(a, b)) << 32 | std::max(a, b);
}

/// Sorted edges: how many are used once.
std::size_t used_once(const std::vector<std::uint64_t>& edges) {
  std::size_t once = 0;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i + 1;
    while (end < edges.size() && edges[end] == edges[i]) ++end;
    once += end - i == 1 ? 1 : 0;
    i = end;
  }
  return once;
}

}  // namespace

bool collapses(std::span<const StarTriangle> star, std::uint64_t own, ComponentScratch& scratch) {
  auto& [inner, outer, labels, members, outside] = scratch;
  inner.clear(), outer.clear(), labels.clear(), members.clear(), outside.clear();
  std::size_t full = 0;            // triangles inside K
  std::size_t ring_steps = 0;      // one vertex in K: a step of the ring from isovertex to isovertex
  std::size_t ring_triangles = 0;  // of these, those that step from component to component
  for (const StarTriangle& t : star) {
    std::size_t in = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t n = (k + 1) % 3;
      const bool a = t.label[k] == own, b = t.label[n] == own;
      if (a && b) inner.push_back(edge_key(t.vertex[k], t.vertex[n]));
      if (a != b) outer.push_back(edge_key(t.vertex[k], t.vertex[n]));
      if (a) {
        ++in;
        members.push_back(t.vertex[k]);
      } else {
        outside.push_back(t.vertex[k]);
        labels.push_back(t.label[k]);
      }
    }
    full += in == 3 ? 1 : 0;
    if (in != 1) continue;
    ++ring_steps;
    ring_triangles += labels.back() != labels[labels.size() - 2] ? 1 : 0;
  }
  const std::size_t neighbours = distinct(labels);
  const std::size_t ring_vertices = distinct(outside);
  std::sort(outer.begin(), outer.end());
  const std::size_t ends = used_once(outer);
  const std::size_t gap = ends == 0 ? 0 : 1;  // a path has one vertex more than steps
  if (ends != 0 && ends != 2) return false;
  if (neighbours != ring_triangles + gap || neighbours < 3 - gap || ring_vertices != ring_steps + gap) return false;
  return distinct(members) + full == distinct(inner) + 1;
}

}  // namespace lamina::clustering
