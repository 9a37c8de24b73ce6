#include "boundary/boundary_paths.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina::boundary {
namespace {

LoopExtent extent_of(const BoundaryVertex& a, const BoundaryVertex& b) {
  LoopExtent e;
  double square = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double d = b.position[k] - a.position[k];
    square += d * d;
    e.low[k] = std::min(a.position[k], b.position[k]);
    e.high[k] = std::max(a.position[k], b.position[k]);
  }
  e.edges = 1;
  e.length = std::sqrt(square);
  const double radius = 0.5 * (static_cast<double>(a.radius) + static_cast<double>(b.radius));
  e.radii = radius > 0 ? e.length / radius : std::numeric_limits<double>::infinity();
  return e;
}

void include(LoopExtent& all, const LoopExtent& more) {
  all.edges += more.edges;
  all.length += more.length;
  all.radii += more.radii;
  for (std::size_t k = 0; k < 3; ++k) {
    all.low[k] = std::min(all.low[k], more.low[k]);
    all.high[k] = std::max(all.high[k], more.high[k]);
  }
}

}  // namespace

BoundaryPaths::BoundaryPaths(const Bounds& bounds, std::size_t attributes,
                             std::function<void(Loop&&, const LoopExtent&)> closed,
                             std::function<void(const LoopExtent&)> left)
    : bounds_{bounds.longest * kRoundedUp, bounds.edges},
      attributes_(attributes),
      closed_(std::move(closed)),
      left_(std::move(left)) {}

void BoundaryPaths::add(const BoundaryBatch& batch, Number first) {
  for (std::size_t i = 0; i < batch.vertices.size(); ++i) {
    BoundaryVertex vertex = batch.vertices[i];
    vertex.number += first;
    const auto [at, fresh] = nodes_.try_emplace(vertex.number);
    if (!fresh) continue;
    at->second.vertex = vertex;
    const auto values = batch.attributes.begin() + static_cast<std::ptrdiff_t>(i * attributes_);
    at->second.attributes.assign(values, values + static_cast<std::ptrdiff_t>(attributes_));
  }
  for (const InnerEdge& e : batch.inner) {
    const auto a = nodes_.find(e.a + first);
    const auto b = nodes_.find(e.b + first);
    // One of them may be of a boundary loop that has been dealt with.
    if (a != nodes_.end()) a->second.inner.push_back(e.b + first);
    if (b != nodes_.end()) b->second.inner.push_back(e.a + first);
  }
  for (BoundaryEdge e : batch.edges) {
    e.from += first;
    e.to += first;
    join(e);
  }
}

void BoundaryPaths::join(const BoundaryEdge& edge) {
  const auto from = nodes_.find(edge.from);
  const auto to = nodes_.find(edge.to);
  // Where a mesh is not manifold, a vertex may be of a boundary loop that has been dealt with: such edges stay by
  // themselves, too.
  if (from == nodes_.end() || to == nodes_.end()) {
    const auto known = from == nodes_.end() ? to : from;
    if (known != nodes_.end()) left_(extent_of(known->second.vertex, known->second.vertex));
    return;
  }
  const LoopExtent extent = extent_of(from->second.vertex, to->second.vertex);
  // Several boundary loops meet in a vertex only where a mesh is not manifold: these edges stay by themselves.
  if (from->second.next != kNone || to->second.entered) {
    left_(extent);
    return;
  }
  from->second.next = edge.to;
  from->second.facing = edge.normal;
  to->second.entered = true;

  Path path{edge.from, edge.to, extent};
  const std::optional<Path> lower = take_ending(edge.from);
  const std::optional<Path> upper =
      take_beginning(edge.to);  // none where the boundary loop closes: it was the lower one
  for (const auto& part : {lower, upper}) {
    if (!part) continue;
    include(path.extent, part->extent);
    path.dropped = path.dropped || part->dropped;
  }
  if (lower) path.first = lower->first;
  if (upper) path.last = upper->last;
  path.dropped = path.dropped || path.extent.radii > bounds_.longest || path.extent.edges > bounds_.edges;
  if (path.dropped) {
    for (const auto& part : {lower, upper}) {
      if (part && !part->dropped) erase_between(part->first, part->last);
    }
    if (lower) nodes_.erase(edge.from);
    if (upper) nodes_.erase(edge.to);
  }
  if (path.first != path.last) {
    last_to_first_[path.last] = path.first;
    by_first_[path.first] = path;
    return;
  }
  if (path.dropped) {
    nodes_.erase(path.first);
    left_(path.extent);
    return;
  }
  closed_(take_loop(path), path.extent);
}

std::optional<BoundaryPaths::Path> BoundaryPaths::take_ending(Number vertex) {
  const auto found = last_to_first_.find(vertex);
  if (found == last_to_first_.end()) return std::nullopt;
  const Path path = by_first_.at(found->second);
  by_first_.erase(found->second);
  last_to_first_.erase(found);
  return path;
}

std::optional<BoundaryPaths::Path> BoundaryPaths::take_beginning(Number vertex) {
  const auto found = by_first_.find(vertex);
  if (found == by_first_.end()) return std::nullopt;
  const Path path = found->second;
  last_to_first_.erase(path.last);
  by_first_.erase(found);
  return path;
}

void BoundaryPaths::erase_between(Number first, Number last) {
  for (Number at = nodes_.at(first).next; at != last;) {
    const auto node = nodes_.find(at);
    at = node->second.next;
    nodes_.erase(node);
  }
}

Loop BoundaryPaths::take_loop(const Path& path) {
  std::vector<Number> order;
  Number at = path.first;
  do {
    order.push_back(at);
    at = nodes_.at(at).next;
  } while (at != path.first);
  // From its least vertex on, against its triangles.
  std::rotate(order.begin(), std::min_element(order.begin(), order.end()), order.end());
  std::reverse(order.begin() + 1, order.end());
  std::unordered_map<Number, std::uint32_t> place;
  for (std::uint32_t i = 0; i < order.size(); ++i) place[order[i]] = i;
  Loop loop;
  const std::size_t n = order.size();
  for (std::uint32_t i = 0; i < n; ++i) {
    const Node& node = nodes_.at(order[i]);
    loop.vertices.push_back(node.vertex);
    loop.attributes.insert(loop.attributes.end(), node.attributes.begin(), node.attributes.end());
    loop.facing.push_back(nodes_.at(order[(i + 1) % n]).facing);
    for (const Number other : node.inner) {
      const auto j = place.find(other);
      if (j == place.end()) {
        loop.leaving.emplace_back(i, other);
      } else if (j->second > i) {
        loop.taken.push_back({i, j->second});
      }
    }
  }
  std::sort(loop.taken.begin(), loop.taken.end());
  loop.taken.erase(std::unique(loop.taken.begin(), loop.taken.end()), loop.taken.end());
  for (const Number number : order) nodes_.erase(number);
  return loop;
}

void BoundaryPaths::forget_below(Number number) {
  std::erase_if(nodes_, [&](const auto& entry) {
    const Node& node = entry.second;
    return entry.first < number && node.next == kNone && !node.entered;
  });
}

void BoundaryPaths::finish() {
  std::vector<Number> firsts;
  for (const auto& [first, path] : by_first_) firsts.push_back(first);
  std::sort(firsts.begin(), firsts.end());
  for (const Number first : firsts) left_(by_first_.at(first).extent);
  by_first_.clear();
  last_to_first_.clear();
  nodes_.clear();
}

}  // namespace lamina::boundary
