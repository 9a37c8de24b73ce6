#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/union_find.h"
#include "normals/sample_window.h"
#include "normals/sides.h"

namespace lamina::normals {
namespace {

/// Evidence between clusters, oriented by the signs so far.
struct Evidence {
  std::uint32_t a = 0, b = 0;
  float sum = 0;
  float weight = 0;  ///< sum of sizes: more than the sum's where links contradict each other
};

/// Sums what goes between the same two clusters, in a fixed order.
void add_up(std::vector<Evidence>& evidence) {
  tbb::parallel_sort(evidence.begin(), evidence.end(), [](const Evidence& l, const Evidence& r) {
    if (l.a != r.a) return l.a < r.a;
    if (l.b != r.b) return l.b < r.b;
    if (l.sum != r.sum) return l.sum < r.sum;
    return l.weight < r.weight;
  });
  std::size_t n = 0;
  for (std::size_t i = 0; i < evidence.size();) {
    Evidence e = evidence[i];
    double sum = 0;
    double weight = 0;
    for (; i < evidence.size() && evidence[i].a == e.a && evidence[i].b == e.b; ++i) {
      sum += double{evidence[i].sum};
      weight += double{evidence[i].weight};
    }
    e.sum = static_cast<float>(sum);
    e.weight = static_cast<float>(weight);
    evidence[n++] = e;
  }
  evidence.resize(n);
}

/// With the votes of places from which all was seen, by node, if there are any.
std::vector<Evidence> evidence_of(const PatchGraph& graph, const std::vector<float>& from_places = {}) {
  std::vector<Evidence> evidence;
  evidence.reserve(graph.edges.size());
  for (const PatchEdge& e : graph.edges) evidence.push_back({e.a, e.b, e.agreement, std::abs(e.agreement)});
  for (std::uint32_t i = 1; i < graph.nodes.size(); ++i) {
    const float vote = graph.nodes[i].vote + (from_places.empty() ? 0 : from_places[i]);
    if (vote != 0) evidence.push_back({kFixed, i, vote, std::abs(vote)});
  }
  add_up(evidence);
  return evidence;
}

/// Moves the evidence from the clusters there were to those there are.
void regroup(std::vector<Evidence>& evidence, SignedUnionFind& forest) {
  for (Evidence& e : evidence) {
    const std::uint32_t a = forest.find(e.a);
    const std::uint32_t b = forest.find(e.b);
    const int sign = forest.sign(e.a) * forest.sign(e.b);
    e = {std::min(a, b), std::max(a, b), sign < 0 ? -e.sum : e.sum, e.weight};
  }
  std::erase_if(evidence, [](const Evidence& e) { return e.a == e.b || e.weight == 0; });
  add_up(evidence);
}

/// Joins clusters until none has anything to say to another, where the sum is at least this share of the weight.
void grow_forest(std::vector<Evidence>& evidence, float least_share, SignedUnionFind& forest, std::size_t nodes) {
  constexpr std::size_t kNothing = ~std::size_t{0};
  std::vector<std::size_t> best(nodes);
  for (bool joined = true; joined;) {
    std::fill(best.begin(), best.end(), kNothing);
    const auto offer = [&](std::uint32_t cluster, std::size_t i) {
      // The fixed node waits to be asked: its ties are many, and none is urgent.
      if (cluster == kFixed) return;
      std::size_t& now = best[cluster];
      if (now == kNothing || std::abs(evidence[i].sum) > std::abs(evidence[now].sum)) now = i;
    };
    for (std::size_t i = 0; i < evidence.size(); ++i) {
      const Evidence& e = evidence[i];
      if (e.sum == 0 || std::abs(e.sum) < least_share * e.weight) continue;
      offer(e.a, i);
      offer(e.b, i);
    }
    joined = false;
    for (const std::size_t i : best) {
      if (i == kNothing) continue;
      const Evidence& e = evidence[i];
      joined = forest.unite(e.a, e.b, static_cast<std::int8_t>(e.sum > 0 ? 1 : -1)) || joined;
    }
    if (joined) regroup(evidence, forest);
  }
}

void read_forest(SignedUnionFind& forest, std::vector<std::uint32_t>& root, PatchSigns& signs) {
  for (std::uint32_t i = 0; i < root.size(); ++i) {
    root[i] = forest.find(i);
    signs.sign[i] = forest.sign(i);
  }
}

/// From where a cloud was seen, as its shape tells.
struct Place {
  std::vector<float> votes;  ///< of what is seen from there, by node; empty: it may have been anywhere
  SignSource source = SignSource::unsure;
};

Place find_place(const Sides& sides, const std::vector<Body>& bodies, const std::vector<std::uint32_t>& root,
                 const std::vector<std::int8_t>& sign) {
  if (const auto room = sides.find_room(bodies, root, sign))
    return {sides.votes_from_within(bodies[*room], *room, root, sign), SignSource::inside};
  if (sides.seen_from_above(bodies, root)) return {sides.votes_from_above(root), SignSource::up};
  return {};
}

}  // namespace

PatchSigns find_signs(const PatchGraph& graph, const InputAxes& axes) {
  constexpr float kAgreed = 0.2F;  // share of evidence between clusters that do not contradict each other
  const std::size_t n = graph.nodes.size();
  PatchSigns signs{std::vector<std::int8_t>(n, 1), std::vector<SignSource>(n, SignSource::fixed), 0};
  SignedUnionFind forest(n);
  std::vector<Evidence> evidence = evidence_of(graph);
  grow_forest(evidence, kAgreed, forest, n);
  std::vector<std::uint32_t> root(n);
  read_forest(forest, root, signs);
  std::vector<std::uint8_t> open(n, 0);
  for (std::uint32_t i = 1; i < n; ++i) open[i] = root[i] != kFixed ? 1 : 0;
  const Sides sides(graph, axes, choose_looks(root));
  std::vector<Body> bodies = sides.bodies(root, signs.sign);
  const Place place = find_place(sides, bodies, root, signs.sign);
  if (!place.votes.empty()) {
    evidence = evidence_of(graph, place.votes);
    forest = SignedUnionFind(n);
    grow_forest(evidence, kAgreed, forest, n);
    read_forest(forest, root, signs);
    bodies = sides.bodies(root, signs.sign);
  }
  for (std::uint32_t i = 1; i < n; ++i) {
    if (open[i] == 0) continue;
    signs.source[i] = root[i] == kFixed ? place.source : sides.choose(bodies[root[i]]).source;
  }
  // Bodies that pass through each other, as a handle through a wall, say nothing of each other: each has its own side.
  // Scraps that noise has cut off are none.
  constexpr std::uint64_t kShare = 200;
  std::uint64_t samples = 0;
  for (const PatchNode& node : graph.nodes) samples += node.count;
  for (std::uint32_t i = 1; i < n; ++i) {
    if (root[i] != i || i == kFixed || bodies[i].samples < samples / kShare) continue;
    const Side side = sides.choose(bodies[i]);
    if (side.source == SignSource::unsure) continue;
    ++signs.components;
    forest.unite(kFixed, i, static_cast<std::int8_t>(side.turn ? -1 : 1));
  }
  regroup(evidence, forest);
  grow_forest(evidence, 0, forest, n);
  const bool any_fixed = std::any_of(root.begin() + 1, root.end(), [](std::uint32_t r) { return r == kFixed; });
  signs.components += any_fixed ? 1 : 0;

  read_forest(forest, root, signs);
  bodies = sides.bodies(root, signs.sign);
  for (std::uint32_t i = 1; i < n; ++i) {
    if (root[i] == kFixed) continue;
    const Body& body = bodies[root[i]];
    signs.components += root[i] == i ? 1 : 0;
    const Side side = sides.choose(body);
    if (side.turn) signs.sign[i] = static_cast<std::int8_t>(-signs.sign[i]);
    signs.source[i] = side.source;
  }
  return signs;
}

std::vector<SignConflicts> count_conflicts(const PatchGraph& graph, const PatchSigns& signs) {
  std::vector<SignConflicts> slabs;
  std::size_t e = 0;
  for (const SlabLinks& slab : graph.slabs) {
    SignConflicts c{slab.same + slab.opposite, slab.opposite};
    for (; e < slab.edge_end; ++e) {
      const PatchEdge& edge = graph.edges[e];
      c.pairs += std::uint64_t{edge.same} + edge.opposite;
      c.conflicts += signs.sign[edge.a] == signs.sign[edge.b] ? edge.opposite : edge.same;
    }
    slabs.push_back(c);
  }
  return slabs;
}

}  // namespace lamina::normals
