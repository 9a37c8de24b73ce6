// The oracle: topology of a whole triangle mesh, by sorting. Independent of the clusterer.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <ostream>
#include <set>
#include <span>
#include <utility>
#include <vector>

namespace lamina::test {

struct Topology {
  std::size_t degenerate = 0, duplicates = 0;  ///< triangles
  std::size_t bad_edges = 0;                   ///< used more than twice, or twice in one direction
  std::size_t bad_vertices = 0;                ///< not exactly one fan
  std::size_t unused_vertices = 0;
  std::int64_t euler = 0;
  std::size_t loops = 0, boundary_edges = 0, components = 0;

  [[nodiscard]] bool manifold() const {
    return degenerate + duplicates + bad_edges + bad_vertices + unused_vertices == 0;
  }
  [[nodiscard]] bool same_surface(const Topology& o) const {
    return euler == o.euler && loops == o.loops && components == o.components;
  }
  friend std::ostream& operator<<(std::ostream& out, const Topology& t) {
    return out << "degenerate " << t.degenerate << " duplicates " << t.duplicates << " bad edges " << t.bad_edges
               << " bad vertices " << t.bad_vertices << " unused " << t.unused_vertices << " euler " << t.euler
               << " loops " << t.loops << " components " << t.components;
  }
};

class Sets {
 public:
  explicit Sets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }
  std::size_t find(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  bool unite(std::size_t a, std::size_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
    return a != b;
  }

 private:
  std::vector<std::size_t> parent_;
};

inline Topology topology_of(std::size_t vertex_count, std::span<const std::array<std::uint32_t, 3>> triangles) {
  Topology result;
  using Edge = std::pair<std::uint64_t, std::size_t>;  // undirected key, 2 * triangle + direction
  std::vector<Edge> edges;
  std::vector<std::array<std::uint32_t, 3>> sorted;
  std::vector<std::size_t> fans(vertex_count, 0);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    std::array<std::uint32_t, 3> t = triangles[i];
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) ++result.degenerate;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k], b = t[(k + 1) % 3];
      edges.emplace_back(static_cast<std::uint64_t>(std::min(a, b)) << 32 | std::max(a, b), 2 * i + (a < b ? 1 : 0));
      ++fans[a];  // every corner a fan of its own, until edges join them
    }
    std::sort(t.begin(), t.end());
    sorted.push_back(t);
  }
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 1; i < sorted.size(); ++i) result.duplicates += sorted[i] == sorted[i - 1] ? 1 : 0;
  std::sort(edges.begin(), edges.end());
  Sets corners(3 * triangles.size()), pieces(triangles.size()), rims(vertex_count);
  std::vector<bool> on_rim(vertex_count, false);
  const auto corner_at = [&](std::size_t triangle, std::uint32_t vertex) {
    std::size_t k = 0;
    while (triangles[triangle][k] != vertex) ++k;
    return 3 * triangle + k;
  };
  std::size_t edge_count = 0, rim_edges = 0, rim_joins = 0, rim_vertices = 0;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i + 1;
    while (end < edges.size() && edges[end].first == edges[i].first) ++end;
    ++edge_count;
    const auto a = static_cast<std::uint32_t>(edges[i].first >> 32), b = static_cast<std::uint32_t>(edges[i].first);
    if (end - i > 2 || (end - i == 2 && (edges[i].second & 1) == (edges[i + 1].second & 1))) ++result.bad_edges;
    if (end - i == 1) {
      ++rim_edges;
      rim_joins += rims.unite(a, b) ? 1 : 0;
      for (const std::uint32_t v : {a, b}) {
        rim_vertices += on_rim[v] ? 0 : 1;
        on_rim[v] = true;
      }
    }
    for (std::size_t k = i + 1; k < end; ++k) {
      const std::size_t s = edges[k - 1].second / 2, t = edges[k].second / 2;
      pieces.unite(s, t);
      for (const std::uint32_t v : {a, b}) fans[v] -= corners.unite(corner_at(s, v), corner_at(t, v)) ? 1 : 0;
    }
    i = end;
  }
  std::size_t used = 0;
  for (const std::size_t f : fans) {
    used += f > 0 ? 1 : 0;
    result.unused_vertices += f == 0 ? 1 : 0;
    result.bad_vertices += f > 1 ? 1 : 0;
  }
  for (std::size_t i = 0; i < triangles.size(); ++i) result.components += pieces.find(i) == i ? 1 : 0;
  result.boundary_edges = rim_edges;
  result.loops = rim_vertices - rim_joins;
  result.euler = static_cast<std::int64_t>(used) - static_cast<std::int64_t>(edge_count) +
                 static_cast<std::int64_t>(triangles.size());
  return result;
}

/// The exact conditions restated naively on the whole mesh: for each component of each cluster, whether it collapses.
/// `cluster` per vertex. Returns the component of every vertex and the verdict of every component.
struct Reference {
  std::vector<std::size_t> component;     ///< per vertex: its component's smallest vertex
  std::map<std::size_t, bool> collapses;  ///< by component
};

inline Reference reference_verdicts(std::span<const std::uint32_t> cluster,
                                    std::span<const std::array<std::uint32_t, 3>> triangles) {
  Reference out;
  Sets sets(cluster.size());
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> uses;
  std::map<std::uint32_t, std::vector<std::size_t>> fan;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangles[i][k], b = triangles[i][(k + 1) % 3];
      if (cluster[a] == cluster[b]) sets.unite(a, b);
      ++uses[std::minmax(a, b)];
      fan[a].push_back(i);
    }
  }
  std::map<std::size_t, std::vector<std::uint32_t>> members;
  for (std::uint32_t v = 0; v < cluster.size(); ++v) {
    out.component.push_back(sets.find(v));
    if (fan.contains(v)) members[sets.find(v)].push_back(v);
  }
  for (const auto& [own, list] : members) {
    std::set<std::size_t> star;
    for (const std::uint32_t v : list) star.insert(fan[v].begin(), fan[v].end());
    std::set<std::pair<std::uint32_t, std::uint32_t>> inner;
    std::set<std::uint32_t> rim_out;
    std::size_t faces = 0, rim_edges = 0;
    // The ring as a graph: from vertex to vertex, and from component to component.
    std::multimap<std::uint32_t, std::uint32_t> steps;
    std::multimap<std::size_t, std::size_t> hops;
    std::set<std::uint32_t> around;
    std::set<std::size_t> neighbours;
    std::set<std::pair<std::uint32_t, std::uint32_t>> rims;
    for (const std::size_t i : star) {
      const auto& t = triangles[i];
      int in = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = t[k], b = t[(k + 1) % 3];
        const bool ina = out.component[a] == own, inb = out.component[b] == own;
        in += ina ? 1 : 0;
        if (!ina) around.insert(a), neighbours.insert(out.component[a]);
        if (ina && inb) inner.insert(std::minmax(a, b));
        if (ina != inb && uses[std::minmax(a, b)] == 1) rims.insert(std::minmax(a, b));
      }
      faces += in == 3 ? 1 : 0;
      if (in != 1) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        if (out.component[t[k]] != own) continue;
        const std::uint32_t b = t[(k + 1) % 3], c = t[(k + 2) % 3];
        steps.emplace(b, c);
        if (out.component[b] != out.component[c]) hops.emplace(out.component[b], out.component[c]);
      }
    }
    rim_edges = rims.size();
    const bool contractible = list.size() + faces == inner.size() + 1;
    const auto chain = [&](const auto& graph, const auto& nodes, std::size_t least) {
      // One simple cycle through all nodes, or one simple path when the boundary passes.
      if (nodes.size() < least || graph.size() + (rim_edges == 2 ? 1 : 0) != nodes.size()) return false;
      std::map<std::uint64_t, int> outs, ins;
      for (const auto& [a, b] : graph) ++outs[a], ++ins[b];
      for (const auto n : nodes) {
        if (outs[n] > 1 || ins[n] > 1) return false;
      }
      std::uint64_t at = *nodes.begin();
      for (const auto n : nodes) {
        if (ins[n] == 0) at = n;
      }
      std::size_t length = 1;
      const std::uint64_t start = at;
      for (;; ++length) {
        const auto it = graph.find(static_cast<typename std::decay_t<decltype(graph)>::key_type>(at));
        if (it == graph.end() || it->second == start) break;
        at = it->second;
      }
      return length == nodes.size();
    };
    const bool rim_ok = rim_edges == 0 || rim_edges == 2;
    out.collapses[own] = contractible && rim_ok && chain(hops, neighbours, rim_edges == 2 ? 2 : 3) &&
                         chain(steps, around, rim_edges == 2 ? 2 : 3);
  }
  return out;
}

}  // namespace lamina::test
