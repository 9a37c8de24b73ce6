#include "simplify/matching.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "lamina/error.h"

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr double kMostOfPass = 0.33;       ///< of the vertices that a pass may take
constexpr double kMoreEdges = 1.4;         ///< than chance asks for: cheap edges lie side by side
constexpr double kIdlePass = 0.01;         ///< of the triangles: a pass over all edges that takes fewer is the last
constexpr double kThinSliver = 0.35;       ///< thinning makes no triangles worse than this (1: equilateral)
constexpr double kLastThinning = 0.01;     ///< of the triangles: a pass that takes fewer is the last
constexpr std::size_t kPassBlock = 1'024;  ///< triangles whose edges are sorted together: they fit a core's cache
constexpr std::size_t kSampleStep = 32;    ///< one of so many triangles says what edges cost
constexpr double kEdgesOfVertex = 3;
/// Of a line's points over that of all, in most edges that a vertex without the budget's limit would fit.
constexpr float kLineOverPlace = 3;
constexpr std::size_t kAhead = 6;  ///< contractions whose stars are on their way while others are made

/// Of vertices.
enum State : std::uint8_t {
  kLocked = 1,
  kHeld = 2,  ///< in this pass: locked, or contracted already
  kNews = 4,  ///< edges there are offered: others were too dear in a pass before
};

/// Costs, none below 0, are told apart by quarters of an octave: by the upper bits of a float.
constexpr std::size_t kSteps = 1'024;
std::size_t step_of(float cost) {
  return std::bit_cast<std::uint32_t>(cost) >> 21U;
}

}  // namespace

Matching::Result Matching::reduce(TriangleMesh& mesh, std::span<const std::uint8_t> locked, std::uint64_t wanted,
                                  const RunContext& run) {
  vertices_.assign(mesh.positions.size(), {});
  for (std::size_t v = 0; v < vertices_.size(); ++v) vertices_[v].at = mesh.positions[v];
  carried_.normals.swap(mesh.normals);
  carried_.values.swap(mesh.attributes);
  begin(std::move(mesh.triangles), locked);
  add_planes();
  survey_rings();
  double more = kMoreEdges;
  while (size_ > wanted) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    // Of n vertices that have d such edges each, some n d / 2 (d + 1) pairs are found one after the other.
    const auto free = static_cast<double>(std::max<std::uint64_t>(free_, 1));
    const double pairs = std::min(kMostOfPass, 0.5 * static_cast<double>(size_ - wanted) / free);
    const double share = more * (2 * pairs / (1 - 2 * pairs)) / (2 * kEdgesOfVertex);
    const std::uint64_t there = size_;
    begin_pass();
    pass(limit(share), wanted);
    stars_.tidy();
    const auto gone = static_cast<double>(there - size_);
    if (share >= 1 && gone < kIdlePass * static_cast<double>(there)) break;
    if (gone < pairs * free) more *= 2;  // half of the pairs wanted
  }
  mesh.triangles = stars_.release();
  for (std::size_t v = 0; v < vertices_.size(); ++v) mesh.positions[v] = vertices_[v].at;
  carried_.normals.swap(mesh.normals);
  carried_.values.swap(mesh.attributes);
  return {size_, std::sqrt(deviation2_)};
}

Matching::Result Matching::thin(ThinPart& part, std::span<const float> tolerances, const RunContext& run) {
  vertices_.swap(part.vertices);
  std::swap(carried_, part.carried);
  begin(std::move(part.triangles), part.locked);
  sliver_ = kThinSliver;
  std::uint64_t there = 0;
  do {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    there = size_;
    begin_pass();
    thin_pass(part, tolerances);
    stars_.tidy();
    end_pass();
  } while (static_cast<double>(there - size_) > kLastThinning * static_cast<double>(there));
  part.triangles = stars_.release();
  vertices_.swap(part.vertices);
  std::swap(carried_, part.carried);
  return {size_, std::sqrt(deviation2_)};
}

void Matching::begin(std::vector<Triangle>&& triangles, std::span<const std::uint8_t> locked) {
  size_ = triangles.size();
  deviation2_ = 0;
  sliver_ = kSliver;
  stars_.reset(std::move(triangles), vertices_.size());
  states_.resize(vertices_.size());
  for (std::size_t v = 0; v < states_.size(); ++v) states_[v] = locked[v] != 0 ? kLocked | kNews : kNews;
}

void Matching::begin_pass() {
  for (std::uint8_t& state : states_) {
    const auto held = static_cast<std::uint8_t>((state & kLocked) != 0 ? kHeld : 0);
    state = static_cast<std::uint8_t>((state & ~kHeld) | held);
  }
}

/// All edges have been offered: one costs the same until one of its ends moves.
void Matching::end_pass() {
  for (std::uint8_t& state : states_) {
    const bool moved = (state & kHeld) != 0 && (state & kLocked) == 0;
    state = static_cast<std::uint8_t>((state & ~kNews) | (moved ? kNews : 0));
  }
}

void Matching::survey_rings() {
  ways_.assign(vertices_.size(), {});
  for (std::uint32_t v = 0; v < vertices_.size(); ++v) survey_ring(v);
  free_ = static_cast<std::uint64_t>(
      std::count_if(states_.begin(), states_.end(), [](std::uint8_t state) { return (state & kLocked) == 0; }));
}

void Matching::add_planes() {
  for (const Triangle& t : stars_.triangles()) {
    const Vec3 n = area_normal(vertices_[t[0]].at, vertices_[t[1]].at, vertices_[t[2]].at);
    const double twice = norm(n);
    if (!(twice > 0)) continue;
    for (const std::uint32_t v : t) vertices_[v].add_plane((1 / twice) * n, 0.5 * twice);
  }
}

/// Finds rims, and locks a vertex that is not that of a manifold.
void Matching::survey_ring(std::uint32_t vertex) {
  const auto visit = [&](auto&& edge) {
    for (const std::uint32_t triangle : stars_.around(vertex)) {
      const Triangle& t = stars_.triangles()[triangle];
      const std::size_t k = corner_of(t, vertex);
      edge(t[(k + 1) % 3], t[(k + 2) % 3]);
    }
  };
  bool manifold = true;
  visit([&](std::uint32_t next, std::uint32_t last) {
    manifold = manifold && ways_[next].out != vertex && ways_[last].in != vertex;
    ways_[next].out = ways_[last].in = vertex;
  });
  int rims = 0;
  visit([&](std::uint32_t next, std::uint32_t last) {
    if (ways_[next].in != vertex) {
      ++rims;
      add_wall(vertex, next, last);
    }
    if (ways_[last].out != vertex) ++rims;
  });
  if (rims > 0) stars_.set_boundary(vertex);
  if (!manifold || rims > 2) states_[vertex] |= kLocked;
}

/// A plane through the rim between two vertices, upright on its triangle.
void Matching::add_wall(std::uint32_t from, std::uint32_t to, std::uint32_t beside) {
  const Vec3 edge = vertices_[to].at - vertices_[from].at, n = cross(edge, vertices_[beside].at - vertices_[from].at);
  if (!(norm(n) > 0)) return;
  const Vec3 across = unit(cross(edge, unit(n)));
  for (const std::uint32_t v : {from, to}) vertices_[v].add_plane(across, dot(edge, edge));
}

/// Into edges_ those of triangles that are theirs to offer: an inner edge is its triangle's that runs along it upwards.
void Matching::gather(std::size_t begin, std::size_t end, std::size_t step) {
  edges_.resize(3 * ((end - begin + step - 1) / step));
  Edge* out = edges_.data();
  for (std::size_t triangle = begin; triangle < end; triangle += step) {
    if (!stars_.alive(static_cast<std::uint32_t>(triangle))) continue;
    const Triangle& t = stars_.triangles()[triangle];
    for (std::size_t k = 0; k < 3; ++k) {  // without branches: chance decides
      const std::uint32_t u = t[k], v = t[(k + 1) % 3];
      __builtin_prefetch(&vertices_[u]);  // lies where no processor foresees it: most of the time went into waiting
      const unsigned rim = unsigned{stars_.boundary(u)} & unsigned{stars_.boundary(v)};
      const auto free = static_cast<unsigned>(((states_[u] | states_[v]) & (kHeld | kNews)) == kNews);
      *out = {u, v};
      out += free & (static_cast<unsigned>(u < v) | rim);
    }
  }
  edges_.resize(static_cast<std::size_t>(out - edges_.data()));
}

/// Keeps of edges_ those that cost no more than dearest(u, v).
template <class Limit>
void Matching::price(const Limit& dearest) {
  costs_.resize(edges_.size());
  std::size_t kept = 0;
  for (const auto [u, v] : edges_) {  // without branches, as above
    const float cost = cost_on_line(vertices_[u], vertices_[v]);
    edges_[kept] = {u, v};
    costs_[kept] = cost;
    kept += static_cast<std::size_t>(cost <= dearest(u, v));
  }
  edges_.resize(kept);
  costs_.resize(kept);
}

/// What an edge may cost for a pass to be offered that share of them.
float Matching::limit(double share) {
  constexpr float kAny = std::numeric_limits<float>::max();
  if (share >= 1) return kAny;
  gather(0, stars_.triangles().size(), kSampleStep);
  price([](std::uint32_t, std::uint32_t) { return kAny; });
  if (costs_.empty()) return kAny;
  const auto place = costs_.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(costs_.size()));
  std::nth_element(costs_.begin(), place, costs_.end());
  return *place;
}

template <class Use>
void Matching::take_cheapest(const Use& use) {
  std::array<std::uint32_t, kSteps> next{};
  for (const float cost : costs_) ++next[step_of(cost)];
  std::uint32_t before = 0;
  for (std::uint32_t& at : next) before += std::exchange(at, before);
  queue_.resize(edges_.size());
  for (std::size_t e = 0; e < edges_.size(); ++e) queue_[next[step_of(costs_[e])]++] = edges_[e];
  for (std::size_t i = 0; i < queue_.size(); ++i) {
    const auto [next_u, next_v] = queue_[std::min(i + kAhead, queue_.size() - 1)];
    stars_.ask_for(next_u);
    stars_.ask_for(next_v);
    const auto [u, v] = queue_[i];
    if (((states_[u] | states_[v]) & kHeld) == 0) use(std::min(u, v), std::max(u, v));
  }
}

void Matching::pass(float dearest, std::uint64_t wanted) {
  const std::size_t count = stars_.triangles().size();
  for (std::size_t begin = 0; begin < count && size_ > wanted; begin += kPassBlock) {
    gather(begin, std::min(begin + kPassBlock, count), 1);
    price([&](std::uint32_t, std::uint32_t) { return dearest; });
    take_cheapest([&](std::uint32_t u, std::uint32_t v) {
      if (size_ > wanted) contract(u, v, std::numeric_limits<float>::max());
    });
  }
}

void Matching::thin_pass(ThinPart& part, std::span<const float> tolerances) {
  const auto alike = [&](std::uint32_t u, std::uint32_t v) {
    for (std::size_t a = 0; a < tolerances.size(); ++a) {
      const auto &low = part.low[a], &high = part.high[a];
      if (std::max(high[u], high[v]) - std::min(low[u], low[v]) > tolerances[a]) return false;
    }
    return true;
  };
  const std::size_t count = stars_.triangles().size();
  for (std::size_t begin = 0; begin < count; begin += kPassBlock) {
    gather(begin, std::min(begin + kPassBlock, count), 1);
    const auto budget = [&](std::uint32_t u, std::uint32_t v) { return part.budgets[u] + part.budgets[v]; };
    price([&](std::uint32_t u, std::uint32_t v) { return kLineOverPlace * budget(u, v); });
    take_cheapest([&](std::uint32_t u, std::uint32_t v) {
      if (!alike(u, v) || !contract(u, v, budget(u, v))) return;
      part.budgets[u] += part.budgets[v];
      for (std::size_t a = 0; a < tolerances.size(); ++a) {
        part.low[a][u] = std::min(part.low[a][u], part.low[a][v]);
        part.high[a][u] = std::max(part.high[a][u], part.high[a][v]);
      }
    });
  }
}

/// False where that costs more, would change the topology, or fold the surface.
bool Matching::contract(std::uint32_t u, std::uint32_t v, float dearest) {
  StandIn &of_u = vertices_[u], &of_v = vertices_[v];
  const Quadric sum = sum_of(of_u, of_v);
  const Vec3 origin = of_u.at, edge = of_v.at - origin;
  const Placed to = place_edge(sum, {}, edge);
  if (!(to.cost <= static_cast<double>(dearest)) || !stars_.contractible(u, v)) return false;
  const auto place = [&](std::uint32_t vertex) -> const Vec3& { return vertices_[vertex].at; };
  if (!keeps_shape(stars_, place, u, v, origin + to.at, sliver_)) return false;
  const double weight = sum.weight();
  if (weight > 0) deviation2_ = std::max(deviation2_, to.cost / weight);
  interpolate(u, v, share_along({}, edge, to.at));
  of_u = stand_in(sum, origin, to.at);
  for (const std::uint32_t vertex : {u, v}) states_[vertex] |= kHeld;
  --free_;
  size_ -= static_cast<std::uint64_t>(stars_.contract(u, v));
  return true;
}

void Matching::interpolate(std::uint32_t u, std::uint32_t v, double share) {
  if (!carried_.normals.empty()) {
    auto& normal = carried_.normals[u];
    const auto& other = carried_.normals[v];
    const auto part = static_cast<float>(share);
    std::array<float, 3> mixed;
    for (std::size_t k = 0; k < 3; ++k) mixed[k] = normal[k] + part * (other[k] - normal[k]);
    const float length2 = mixed[0] * mixed[0] + mixed[1] * mixed[1] + mixed[2] * mixed[2];
    const float scale = 1 / std::sqrt(length2);
    if (length2 > 0) normal = {scale * mixed[0], scale * mixed[1], scale * mixed[2]};
  }
  for (auto& values : carried_.values) values[u] += static_cast<float>(share) * (values[v] - values[u]);
}

void keep_vertices(TriangleMesh& mesh, std::span<const std::uint8_t> stays) {
  const auto keep = [&](auto& values) {
    std::size_t kept = 0;
    for (std::size_t v = 0; v < values.size(); ++v) {
      if (stays[v] != 0) values[kept++] = values[v];
    }
    values.resize(kept);
  };
  keep(mesh.positions);
  keep(mesh.normals);
  for (auto& values : mesh.attributes) keep(values);
}

std::vector<std::uint32_t> drop_unused(TriangleMesh& mesh) {
  std::vector<std::uint8_t> used(mesh.positions.size());
  for (const auto& t : mesh.triangles) {
    for (const std::uint32_t v : t) used[v] = 1;
  }
  std::vector<std::uint32_t> number(used.size(), kNone);
  std::uint32_t kept = 0;
  for (std::size_t v = 0; v < used.size(); ++v) {
    if (used[v] != 0) number[v] = kept++;
  }
  keep_vertices(mesh, used);
  for (auto& t : mesh.triangles) {
    for (std::uint32_t& v : t) v = number[v];
  }
  return number;
}

PartResult PartSimplifier::simplify(TriangleMesh& mesh, std::span<const std::uint8_t> locked, std::uint64_t triangles,
                                    const RunContext& run) {
  PartResult result;
  result.deviation = matchings_.local().reduce(mesh, locked, triangles, run).deviation;
  result.numbers = drop_unused(mesh);
  return result;
}

}  // namespace lamina::simplify
