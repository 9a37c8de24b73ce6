// Whole-mesh facts for tests: manifoldness, orientation, duplicates, Euler characteristics. Straightforward on purpose.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

namespace lamina::test {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

struct MeshFacts {
  std::size_t degenerate = 0;     ///< triangles that repeat a vertex
  std::size_t duplicates = 0;     ///< triangles over the same three vertices as another
  std::size_t complex_edges = 0;  ///< used more than once in one direction: over two triangles, or turned round
  std::size_t several_fans = 0;   ///< vertices whose triangles are not one fan
  std::vector<std::array<std::uint32_t, 2>> boundary;  ///< directed edges without a partner
  std::vector<long> euler;                             ///< V - E + F of every component
  [[nodiscard]] bool is_manifold() const {
    return degenerate == 0 && duplicates == 0 && complex_edges == 0 && several_fans == 0;
  }
  [[nodiscard]] bool is_closed_manifold() const { return is_manifold() && boundary.empty(); }
};

class UnionFind {
 public:
  explicit UnionFind(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }
  std::size_t find(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void unite(std::size_t a, std::size_t b) { parent_[find(a)] = find(b); }

 private:
  std::vector<std::size_t> parent_;
};

inline MeshFacts check_mesh(const Triangles& triangles) {
  MeshFacts facts;
  std::uint32_t vertices = 0;
  Triangles sorted = triangles;
  for (auto& t : sorted) {
    std::sort(t.begin(), t.end());
    vertices = std::max(vertices, t[2] + 1);
    if (t[0] == t[1] || t[1] == t[2]) ++facts.degenerate;
  }
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 1; i < sorted.size(); ++i) facts.duplicates += sorted[i] == sorted[i - 1] ? 1 : 0;

  struct HalfEdge {
    std::uint32_t from, to;
    std::size_t corner;  // 3 triangle + index of `from`
    auto operator<=>(const HalfEdge&) const = default;
  };
  std::vector<HalfEdge> edges;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) edges.push_back({triangles[t][i], triangles[t][(i + 1) % 3], 3 * t + i});
  }
  std::sort(edges.begin(), edges.end());
  const auto next_corner = [](std::size_t c) { return c - c % 3 + (c + 1) % 3; };
  UnionFind fans(edges.size());
  UnionFind components(vertices);
  std::map<std::size_t, long> edge_count;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const HalfEdge& e = edges[i];
    if (i > 0 && edges[i - 1].from == e.from && edges[i - 1].to == e.to) ++facts.complex_edges;
    components.unite(e.from, e.to);
    const auto partner = std::lower_bound(edges.begin(), edges.end(), HalfEdge{e.to, e.from, 0});
    if (partner == edges.end() || partner->from != e.to || partner->to != e.from) {
      facts.boundary.push_back({e.from, e.to});
      continue;
    }
    fans.unite(e.corner, next_corner(partner->corner));
    fans.unite(next_corner(e.corner), partner->corner);
  }
  std::vector<std::set<std::size_t>> fans_of(vertices);
  for (const HalfEdge& e : edges) fans_of[e.from].insert(fans.find(e.corner));
  std::map<std::size_t, long> euler;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    if (fans_of[v].size() > 1) ++facts.several_fans;
    if (!fans_of[v].empty()) ++euler[components.find(v)];
  }
  std::set<std::pair<std::uint32_t, std::uint32_t>> undirected;
  for (const HalfEdge& e : edges) undirected.insert(std::minmax(e.from, e.to));
  for (const auto& [a, b] : undirected) --euler[components.find(a)];
  for (const auto& t : triangles) ++euler[components.find(t[0])];
  for (const auto& [root, chi] : euler) facts.euler.push_back(chi);
  return facts;
}

}  // namespace lamina::test
