#include "normals/sides.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "base/union_find.h"
#include "meshes/vec3.h"
#include "normals/directions.h"
#include "normals/sample_window.h"

namespace lamina::normals {
namespace {

using meshes::dot;
using meshes::norm;
using meshes::operator*;
using meshes::to_double;
using meshes::Vec3;

constexpr double kOpen = 0.3;     ///< openness: half a sphere has 0.5
constexpr double kTight = 0.1;    ///< likewise: hardly a gap
constexpr double kSheet = 0.5;    ///< likewise: hills and valleys have more
constexpr double kLevel = 0.75;   ///< cosine
constexpr double kUpright = 0.5;  ///< cosine
constexpr double kClear = 0.1;    ///< share of the area that makes a majority clear

/// The area that counts for what is seen: strays stand for more than they are.
double area_of(const PatchNode& node, float cell) {
  constexpr double kMost = 2;
  return std::min(double{node.area}, kMost * double{cell} * double{cell});
}

/// What sight says for a patch's front, -1..1: it is the side from which one sees farther, if the other is closed.
double preference(const Sight& s) {
  if (s.front.is_closed() != s.back.is_closed()) return s.back.is_closed() ? 1 : -1;
  if (!s.front.is_closed()) return 0;
  constexpr double kHalf = 0.5;
  const double both = double{s.front.way} + double{s.back.way};
  return both > 0 ? kHalf * (double{s.front.way} - double{s.back.way}) / both : 0;
}

bool is_shut_in(const View& view, const View& other) {
  constexpr float kFarther = 1.2F;
  return view.is_closed() && other.way > kFarther * view.way;
}

/// How much a patch's front faces up, -1..1, if the sky is open above it.
double skyward(const PatchNode& node, const Sight& s, const Vec3& up) {
  const Vec3 outward = to_double(node.outward);
  const double upward = dot(outward, up);
  constexpr float kHalf = 0.5F;
  return (upward > 0 ? s.front : s.back).open < kHalf || node.area == 0 ? 0 : upward / double{node.area};
}

/// The direction across a cloud much wider than it is high; towards the positive side of the input axis next to it.
std::optional<Vec3> flat_across(const PatchGraph& graph, const InputAxes& axes) {
  constexpr double kFlat = 0.25;  // of the variance along the shorter side
  constexpr double kWide = 0.02;
  Moments m;
  for (std::size_t i = 1; i < graph.nodes.size(); ++i)
    m.add(graph.nodes[i].centre, area_of(graph.nodes[i], graph.cell) / (double{graph.cell} * double{graph.cell}));
  const Plane plane = fit_plane(m);
  if (!plane.valid() || plane.least > kFlat * plane.middle || plane.middle < kWide * plane.most) return {};
  const Vec3 normal = to_double(plane.normal);
  double along = 0;
  for (const std::array<float, 3>& axis : {axes[2], axes[1], axes[0]}) {
    const double cosine = dot(normal, to_double(axis));
    if (std::abs(cosine) > std::abs(along)) along = cosine;
  }
  return along < 0 ? -1.0 * normal : normal;
}

}  // namespace

double Body::openness() const {
  return norm(facing) / area;
}

bool Body::encloses() const {
  constexpr double kLittle = 0.1;  // of the volume that the same area could enclose
  // Thin, but with both faces and a rim all around.
  constexpr double kShut = 0.05;
  constexpr double kThin = 0.005;
  return openness() <= kOpen && std::abs(volume) > (openness() <= kShut ? kThin : kLittle) * size;
}

bool is_inside_out(const Body& body) {
  return body.volume < 0;
}

Sides::Sides(const PatchGraph& graph, const InputAxes& axes, std::vector<float> looks)
    : graph_(graph),
      around_(graph),
      looks_(std::move(looks)),
      sights_(look_around(graph, around_, looks_)),
      up_(to_double(axes[2])) {
  if (!(graph.cell > 0)) return;
  flat_ = flat_across(graph, axes);
  is_level_ = flat_ && dot(*flat_, up_) > kLevel;
}

std::vector<Body> Sides::bodies(const std::vector<std::uint32_t>& root, const std::vector<std::int8_t>& sign) const {
  const std::size_t n = graph_.nodes.size();
  std::vector<Body> bodies(n);
  for (std::size_t i = 1; i < n; ++i) {
    const PatchNode& node = graph_.nodes[i];
    Body& body = bodies[root[i]];
    body.area += double{node.area};
    body.samples += node.count;
    for (std::size_t a = 0; a < 3; ++a) {
      body.moment[a] += double{node.area} * double{node.centre[a]};
      body.facing[a] += sign[i] * double{node.outward[a]};
    }
    const double area = area_of(node, graph_.cell);
    body.counted += area;
    const double looked = double{looks_[i]} * area;
    body.seen += looked * sign[i] * preference(sights_[i]);
    body.skyward += looked * sign[i] * skyward(node, sights_[i], up_);
    const bool in = is_shut_in(sights_[i].front, sights_[i].back);
    const bool out = is_shut_in(sights_[i].back, sights_[i].front);
    ((sign[i] > 0) ? body.shut_in : body.shut_out) += in ? looked : 0;
    ((sign[i] > 0) ? body.shut_out : body.shut_in) += out ? looked : 0;
  }
  for (std::size_t i = 1; i < n; ++i) {
    const PatchNode& node = graph_.nodes[i];
    Body& body = bodies[root[i]];
    Vec3 offset{};
    for (std::size_t a = 0; a < 3; ++a) offset[a] = double{node.centre[a]} - body.moment[a] / body.area;
    body.volume += sign[i] * (dot(to_double(node.outward), offset) + double{node.bulge});
    body.size += double{node.area} * norm(offset);
  }
  return bodies;
}

std::optional<std::uint32_t> Sides::find_room(const std::vector<Body>& bodies, const std::vector<std::uint32_t>& root,
                                              const std::vector<std::int8_t>& sign) const {
  std::optional<std::uint32_t> widest;
  for (std::uint32_t i = 1; i < bodies.size(); ++i) {
    if (root[i] != i || root[i] == kFixed || !bodies[i].encloses()) continue;
    if (!widest || std::abs(bodies[i].volume) > std::abs(bodies[*widest].volume)) widest = i;
  }
  if (!widest) return {};
  // Turned outside out, what part of it would face into a dead end?
  const Body& body = bodies[*widest];
  double all = 0;
  for (const Body& other : bodies) all += other.counted;
  constexpr double kMost = 0.5;  // of the cloud
  if (body.counted < kMost * all) return {};
  double hidden = is_inside_out(body) ? body.shut_out : body.shut_in;
  double area = 0;
  for (std::uint32_t i = 1; i < bodies.size(); ++i) {
    constexpr double kSealed = 0.05;  // openness: what a scanner sees of a thing always has gaps
    const bool own = root[i] == *widest;
    const double here = area_of(graph_.nodes[i], graph_.cell);
    if (own) area += here;
    if (own || root[i] == kFixed || (bodies[root[i]].encloses() && bodies[root[i]].openness() < kSealed)) continue;
    if (sights_[i].front.is_closed() && sights_[i].back.is_closed()) hidden += double{looks_[i]} * here;
  }
  constexpr double kMuch = 0.0125;
  if (hidden < kMuch * area) return {};
  constexpr double kSeen = 0.89;
  return share_seen_within(around_, walls_of(body, *widest, root, sign)) > kSeen ? widest : std::nullopt;
}

std::optional<Wall> Sides::wall_of(std::uint32_t patch) const {
  constexpr double kFlat = 0.5;  // of its area
  const PatchNode& node = graph_.nodes[patch];
  const Vec3 outward = to_double(node.outward);
  const double length = norm(outward);
  if (!(length > kFlat * double{node.area})) return {};
  return Wall{around_.place(node), (1 / length) * outward,
              area_of(node, graph_.cell) / (around_.side() * around_.side())};
}

std::vector<Wall> Sides::walls_of(const Body& body, std::uint32_t body_root, const std::vector<std::uint32_t>& root,
                                  const std::vector<std::int8_t>& sign) const {
  const double inward = is_inside_out(body) ? 1 : -1;
  std::vector<Wall> walls;
  for (std::uint32_t i = 1; i < root.size(); ++i) {
    if (root[i] != body_root) continue;
    std::optional<Wall> wall = wall_of(i);
    if (!wall) continue;
    wall->facing = inward * sign[i] * wall->facing;
    walls.push_back(*wall);
  }
  return walls;
}

std::vector<float> Sides::votes_from_within(const Body& room, std::uint32_t room_root,
                                            const std::vector<std::uint32_t>& root,
                                            const std::vector<std::int8_t>& sign) const {
  std::vector<Wall> walls;
  std::vector<std::uint32_t> patches;
  for (std::uint32_t i = 1; i < root.size(); ++i) {
    if (root[i] == kFixed) continue;
    if (const std::optional<Wall> wall = wall_of(i)) {
      walls.push_back(*wall);
      patches.push_back(i);
    }
  }
  const std::vector<Vec3> places = places_within(around_, walls_of(room, room_root, root, sign));
  const std::vector<double> seen_from = normals::votes_from_within(around_, places, walls);
  std::vector<float> votes(root.size(), 0);
  for (std::size_t w = 0; w < walls.size(); ++w)
    votes[patches[w]] = static_cast<float>(seen_from[w] * graph_.nodes[patches[w]].count);
  return votes;
}

Side Sides::choose(const Body& body) const {
  const double facing = norm(body.facing);
  const double openness = body.openness();
  const double upward = dot(body.facing, up_);
  const SignSource level = is_level_ ? SignSource::up : SignSource::unsure;
  // Ground lies open above, whatever stands on it.
  if (openness > kSheet && std::abs(upward) > kLevel * facing) return {upward < 0, level};
  if (body.encloses() && openness < kTight) return {is_inside_out(body), SignSource::outside};
  // Whatever was not seen from within faces the sky where that is open above.
  if (std::abs(body.skyward) > kClear * body.counted)
    return {body.skyward < 0, is_level_ ? SignSource::up : SignSource::sight};
  if (body.encloses()) return {is_inside_out(body), SignSource::outside};
  if (std::abs(body.seen) > kClear * body.counted) return {body.seen < 0, SignSource::sight};
  if (openness > kOpen) {
    if (std::abs(upward) > kUpright * facing) return {upward < 0, level};
    const double across = flat_ ? dot(body.facing, *flat_) : 0;
    if (std::abs(across) > kUpright * facing) return {across < 0, SignSource::unsure};
  }
  return {is_inside_out(body), SignSource::unsure};
}

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

/// With the votes of places inside a room, by node, if there are any.
std::vector<Evidence> evidence_of(const PatchGraph& graph, const std::vector<float>& from_within = {}) {
  std::vector<Evidence> evidence;
  evidence.reserve(graph.edges.size());
  for (const PatchEdge& e : graph.edges) evidence.push_back({e.a, e.b, e.agreement, std::abs(e.agreement)});
  for (std::uint32_t i = 1; i < graph.nodes.size(); ++i) {
    const float vote = graph.nodes[i].vote + (from_within.empty() ? 0 : from_within[i]);
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
  if (const auto room = sides.find_room(bodies, root, signs.sign)) {
    evidence = evidence_of(graph, sides.votes_from_within(bodies[*room], *room, root, signs.sign));
    forest = SignedUnionFind(n);
    grow_forest(evidence, kAgreed, forest, n);
    read_forest(forest, root, signs);
    bodies = sides.bodies(root, signs.sign);
  }
  for (std::uint32_t i = 1; i < n; ++i) {
    if (open[i] == 0) continue;
    signs.source[i] = root[i] == kFixed ? SignSource::inside : sides.choose(bodies[root[i]]).source;
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
