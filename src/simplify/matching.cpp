#include "simplify/matching.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "lamina/error.h"
#include "simplify/contraction.h"

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr double kMostOfPass = 0.33;    ///< of the vertices that a pass may take
constexpr double kMoreEdges = 1.4;      ///< than chance asks for: cheap edges lie side by side
constexpr double kIdlePass = 0.01;      ///< of the triangles: a pass over all edges that takes fewer is the last
constexpr float kFirstBudget = 0.1F;    ///< thinning: share of the budget in the first pass, for the cheapest edges
constexpr double kThinSliver = 0.35;    ///< thinning makes no triangles worse than this (1: equilateral)
constexpr double kLastThinning = 0.05;  ///< of the triangles: a pass of the whole budget that takes fewer is the last
constexpr std::size_t kPassBlock = 1'024;  ///< triangles whose edges are sorted together: they fit a core's cache
constexpr std::size_t kSampleStep = 32;    ///< one of so many triangles says what edges cost
constexpr double kEdgesOfVertex = 3;
constexpr unsigned kCostShift = 32;  ///< in the queue
constexpr std::size_t kAhead = 6;    ///< contractions whose stars are on their way while others are made

/// The middle of the box of a mesh.
Vec3 middle_of(const std::vector<Vec3>& positions) {
  if (positions.empty()) return {};
  Vec3 low = positions[0], high = low;
  for (const Vec3& at : positions) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], at[k]);
      high[k] = std::max(high[k], at[k]);
    }
  }
  return 0.5 * (low + high);
}

/// Asks for an element that will be read soon: what belongs to a vertex lies where no processor foresees it, and most
/// of the time went into waiting for it.
template <class T>
void ask_for(const T& element) {
  constexpr std::size_t kLine = 64;
  const char* const begin = reinterpret_cast<const char*>(&element);
  __builtin_prefetch(begin);
  if constexpr (sizeof(T) > 16) __builtin_prefetch(begin + std::min(sizeof(T) - 1, kLine));
}

/// Floats that are not negative stand in the order of their bits.
std::uint64_t queue_key(double cost, std::size_t edge) {
  return std::uint64_t{std::bit_cast<std::uint32_t>(static_cast<float>(cost))} << kCostShift | edge;
}
float cost_of(std::uint64_t key) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(key >> kCostShift));
}

}  // namespace

Matching::Result Matching::reduce(TriangleMesh& mesh, std::span<const std::uint8_t> locked, std::uint64_t wanted,
                                  const RunContext& run) {
  begin(mesh, locked);
  add_planes();
  survey_rings();
  double more = kMoreEdges;
  while (size_ > wanted) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    held_ = locked_;
    // Of n vertices that have d such edges each, some n d / 2 (d + 1) pairs are found one after the other.
    const auto free = static_cast<double>(std::max<std::uint64_t>(free_, 1));
    const double pairs = std::min(kMostOfPass, 0.5 * static_cast<double>(size_ - wanted) / free);
    const double share = more * (2 * pairs / (1 - 2 * pairs)) / (2 * kEdgesOfVertex);
    const std::uint64_t there = size_;
    pass(limit(share), wanted);
    stars_.tidy();
    const auto gone = static_cast<double>(there - size_);
    if (share >= 1 && gone < kIdlePass * static_cast<double>(there)) break;
    if (gone < pairs * free) more *= 2;  // half of the pairs wanted
  }
  mesh.triangles = stars_.release();
  return {size_, std::sqrt(deviation2_)};
}

Matching::Result Matching::thin(ThinPart& part, std::span<const float> tolerances, const RunContext& run) {
  begin(part.mesh, part.locked);
  sliver_ = kThinSliver;
  for (std::size_t v = 0; v < positions_.size(); ++v) quadrics_[v] = part.quadrics[v].moved(positions_[v]);
  survey_rings();
  for (std::uint32_t v = 0; v < positions_.size(); ++v) locked_[v] |= static_cast<std::uint8_t>(stars_.boundary(v));
  for (bool first = true;; first = false) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    held_ = locked_;
    const std::uint64_t there = size_;
    thin_pass(part, tolerances, first ? kFirstBudget : 1);
    stars_.tidy();
    if (!first) {  // an edge costs the same until one of its ends moves
      for (std::size_t v = 0; v < news_.size(); ++v) news_[v] = static_cast<std::uint8_t>(held_[v] & ~locked_[v]);
    }
    if (!first && static_cast<double>(there - size_) <= kLastThinning * static_cast<double>(there)) break;
  }
  part.mesh.triangles = stars_.release();
  part.locked = locked_;
  for (std::size_t v = 0; v < positions_.size(); ++v) part.quadrics[v] = quadrics_[v].moved(-1 * positions_[v]);
  return {size_, std::sqrt(deviation2_)};
}

void Matching::begin(TriangleMesh& mesh, std::span<const std::uint8_t> locked) {
  mesh_ = &mesh;
  centre_ = middle_of(mesh.positions);
  positions_.clear();
  for (const Vec3& at : mesh.positions) positions_.push_back(at - centre_);
  size_ = mesh.triangles.size();
  deviation2_ = 0;
  sliver_ = kSliver;
  news_.assign(positions_.size(), 1);
  stars_.reset(std::move(mesh.triangles), positions_.size());
  locked_.assign(locked.begin(), locked.end());
  quadrics_.assign(positions_.size(), {});
}

void Matching::survey_rings() {
  ways_.assign(positions_.size(), {});
  for (std::uint32_t v = 0; v < positions_.size(); ++v) survey_ring(v);
  free_ = static_cast<std::uint64_t>(std::count(locked_.begin(), locked_.end(), 0));
}

void Matching::add_planes() {
  for (const Triangle& t : stars_.triangles()) {
    const Vec3 n = cross(positions_[t[1]] - positions_[t[0]], positions_[t[2]] - positions_[t[0]]);
    const double twice = norm(n);
    if (!(twice > 0)) continue;
    const Quadric plane = plane_quadric(positions_[t[0]], (1 / twice) * n, 0.5 * twice, kNormalNoise);
    for (const std::uint32_t v : t) quadrics_[v] += plane;
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
  if (!manifold || rims > 2) locked_[vertex] = 1;
}

/// A plane through the rim between two vertices, upright on its triangle.
void Matching::add_wall(std::uint32_t from, std::uint32_t to, std::uint32_t beside) {
  const Vec3 edge = positions_[to] - positions_[from], n = cross(edge, positions_[beside] - positions_[from]);
  if (!(norm(n) > 0)) return;
  const Quadric wall = plane_quadric(positions_[from], unit(cross(edge, unit(n))), dot(edge, edge), kNormalNoise);
  quadrics_[from] += wall;
  quadrics_[to] += wall;
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
      ask_for(quadrics_[u]);
      ask_for(positions_[u]);
      const unsigned rim = unsigned{stars_.boundary(u)} & unsigned{stars_.boundary(v)};
      const auto free = static_cast<unsigned>((held_[u] | held_[v]) == 0) & unsigned{(news_[u] | news_[v]) != 0};
      *out = {u, v};
      out += free & (static_cast<unsigned>(u < v) | rim);
    }
  }
  edges_.resize(static_cast<std::size_t>(out - edges_.data()));
}

/// What is in edges_ into the queue, where it costs no more than dearest(u, v).
template <class Limit>
void Matching::price(const Limit& dearest) {
  queue_.resize(edges_.size());
  std::uint64_t* out = queue_.data();
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    const auto [u, v] = edges_[e];
    Quadric sum = quadrics_[u];
    sum += quadrics_[v];
    *out = queue_key(place_edge(sum, positions_[u], positions_[v]).cost, e);
    out += static_cast<unsigned>(cost_of(*out) <= dearest(u, v));  // without a branch, as above
  }
  queue_.resize(static_cast<std::size_t>(out - queue_.data()));
}

/// What an edge may cost for a pass to be offered that share of them.
float Matching::limit(double share) {
  constexpr float kAny = std::numeric_limits<float>::max();
  if (share >= 1) return kAny;
  gather(0, stars_.triangles().size(), kSampleStep);
  price([](std::uint32_t, std::uint32_t) { return kAny; });
  if (queue_.empty()) return kAny;
  const auto place = queue_.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(queue_.size()));
  std::nth_element(queue_.begin(), place, queue_.end());
  return cost_of(*place);
}

template <class Use>
void Matching::take_queue(const Use& use) {
  std::sort(queue_.begin(), queue_.end());
  for (std::size_t i = 0; i < queue_.size(); ++i) {
    const auto [next, beside] = edges_[static_cast<std::uint32_t>(queue_[std::min(i + kAhead, queue_.size() - 1)])];
    stars_.ask_for(next);
    stars_.ask_for(beside);
    const auto [u, v] = edges_[static_cast<std::uint32_t>(queue_[i])];
    if (held_[u] == 0 && held_[v] == 0) use(std::min(u, v), std::max(u, v));
  }
}

void Matching::pass(float dearest, std::uint64_t wanted) {
  const std::size_t count = stars_.triangles().size();
  for (std::size_t begin = 0; begin < count && size_ > wanted; begin += kPassBlock) {
    gather(begin, std::min(begin + kPassBlock, count), 1);
    price([&](std::uint32_t, std::uint32_t) { return dearest; });
    take_queue([&](std::uint32_t u, std::uint32_t v) {
      if (size_ > wanted) contract(u, v);
    });
  }
}

void Matching::thin_pass(ThinPart& part, std::span<const float> tolerances, float share) {
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
    price([&](std::uint32_t u, std::uint32_t v) { return share * (part.budgets[u] + part.budgets[v]); });
    take_queue([&](std::uint32_t u, std::uint32_t v) {
      if (!alike(u, v) || !contract(u, v)) return;
      part.budgets[u] += part.budgets[v];
      for (std::size_t a = 0; a < tolerances.size(); ++a) {
        part.low[a][u] = std::min(part.low[a][u], part.low[a][v]);
        part.high[a][u] = std::max(part.high[a][u], part.high[a][v]);
      }
    });
  }
}

/// False where that would change the topology, or fold the surface.
bool Matching::contract(std::uint32_t u, std::uint32_t v) {
  if (!mesh_->normals.empty()) {
    ask_for(mesh_->normals[u]);
    ask_for(mesh_->normals[v]);
  }
  for (const auto& values : mesh_->attributes) {
    ask_for(values[u]);
    ask_for(values[v]);
  }
  if (!stars_.contractible(u, v)) return false;
  Quadric sum = quadrics_[u];
  sum += quadrics_[v];
  const Placed to = place_edge(sum, positions_[u], positions_[v]);
  if (!keeps_shape(stars_, positions_, u, v, to.at, sliver_)) return false;
  const double weight = sum.weight();
  if (weight > 0) deviation2_ = std::max(deviation2_, to.cost / weight);
  const double share = share_along(positions_[u], positions_[v], to.at);
  if (!mesh_->normals.empty()) {
    const Vec3 mixed = (1 - share) * to_double(mesh_->normals[u]) + share * to_double(mesh_->normals[v]);
    if (norm(mixed) > 0) mesh_->normals[u] = to_float(unit(mixed));
  }
  for (auto& values : mesh_->attributes) values[u] += static_cast<float>(share) * (values[v] - values[u]);
  positions_[u] = to.at;
  mesh_->positions[u] = to.at + centre_;
  quadrics_[u] = sum;
  held_[u] = held_[v] = 1;
  --free_;
  size_ -= static_cast<std::uint64_t>(stars_.contract(u, v));
  return true;
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
