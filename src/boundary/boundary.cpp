#include "boundary/boundary.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>
#include <type_traits>
#include <utility>

#include "base/hashing.h"
#include "lamina/error.h"
#include "meshes/vec3.h"

namespace lamina::boundary {
namespace {

template <class T>
void put(const std::vector<T>& values, std::vector<std::byte>& out) {
  static_assert(std::is_trivially_copyable_v<T>);
  const std::uint64_t count = values.size();
  const auto append = [&](const void* data, std::size_t bytes) {
    const auto* from = static_cast<const std::byte*>(data);
    out.insert(out.end(), from, from + bytes);
  };
  append(&count, sizeof count);
  append(values.data(), values.size() * sizeof(T));
}

template <class T>
void get(std::span<const std::byte>& left, std::vector<T>& values) {
  const auto require = [](bool ok) {
    if (!ok) throw Error(ExitCode::unreadable, "the boundary of a part is damaged; make the chunk again");
  };
  std::uint64_t count = 0;
  require(left.size() >= sizeof count);
  std::memcpy(&count, left.data(), sizeof count);
  left = left.subspan(sizeof count);
  require(count <= left.size() / sizeof(T));
  const std::size_t before = values.size();
  values.resize(before + count);
  if (count > 0) std::memcpy(values.data() + before, left.data(), count * sizeof(T));
  left = left.subspan(count * sizeof(T));
}

}  // namespace

void pack(const BoundaryBatch& batch, std::vector<std::byte>& out) {
  put(batch.vertices, out);
  put(batch.attributes, out);
  put(batch.inner, out);
  put(batch.edges, out);
  put(batch.loose, out);
}

BoundaryBatch unpack(std::span<const std::byte> bytes) {
  BoundaryBatch batch;
  while (!bytes.empty()) {
    get(bytes, batch.vertices);
    get(bytes, batch.attributes);
    get(bytes, batch.inner);
    get(bytes, batch.edges);
    get(bytes, batch.loose);
  }
  return batch;
}

BoundaryFinder::BoundaryFinder(std::uint64_t first, const VertexBatch& below) : origin_(first), part_below_(true) {
  Slab& slab = slabs_[2];
  slab.vertices = below;
  slab.first = first - below.size();
  base_ = slabs_[0].first = slabs_[1].first = slab.first;
  turns_.assign(below.size(), 0);
}

void BoundaryFinder::count(const Triangles& triangles) {
  const std::uint64_t end = base_ + turns_.size();
  for (const auto& t : triangles) {
    if (t[0] < slabs_[1].first || t[1] < slabs_[1].first || t[2] < slabs_[1].first || t[0] >= end || t[1] >= end ||
        t[2] >= end)
      throw Error(ExitCode::internal, "boundary: a triangle names a vertex of none of the last two slabs");
    // Scrambled, so that sums vanish for nothing but pairs.
    const std::uint64_t a = scrambled(t[0]), b = scrambled(t[1]), c = scrambled(t[2]);
    turns_[t[0] - base_] += b - c;
    turns_[t[1] - base_] += c - a;
    turns_[t[2] - base_] += a - b;
  }
}

void BoundaryFinder::slide(const VertexBatch& vertices, const Triangles& triangles) {
  const std::uint64_t gone = slabs_[0].vertices.size();
  turns_.erase(turns_.begin(), turns_.begin() + static_cast<std::ptrdiff_t>(gone));
  base_ += gone;
  std::swap(slabs_[0], slabs_[1]);
  std::swap(slabs_[1], slabs_[2]);
  slabs_[2].vertices = vertices;
  slabs_[2].first = slabs_[1].end();
  turns_.resize(turns_.size() + vertices.size(), 0);
  std::swap(before_, last_);
  last_ = triangles;
  count(last_);
}

void BoundaryFinder::add(const VertexBatch& vertices, const Triangles& triangles, BoundaryBatch& out) {
  slide(vertices, triangles);
  settle(std::exchange(part_below_, false), out);
}

/// The slab before the last has all its triangles: its edges, and those to the one below it, are decided.
void BoundaryFinder::settle(bool loose, BoundaryBatch& out) {
  const Slab& slab = slabs_[1];
  const auto from = turns_.begin() + static_cast<std::ptrdiff_t>(slab.first - base_);
  const auto to = from + static_cast<std::ptrdiff_t>(slab.vertices.size());
  if (std::all_of(from, to, [](std::uint64_t t) { return t == 0; })) return;
  put_vertices(slab, out);
  found_.clear();
  collect(before_, slab);
  collect(last_, slab);
  std::sort(found_.begin(), found_.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.high, a.low, a.up, a.triangle) < std::tie(b.high, b.low, b.up, b.triangle);
  });
  const auto number = [&](std::uint64_t v) { return static_cast<Number>(v) - static_cast<Number>(origin_); };
  for (std::size_t i = 0, j = 0; i < found_.size(); i = j) {
    for (j = i; j < found_.size() && found_[j].low == found_[i].low && found_[j].high == found_[i].high;) ++j;
    const HalfEdge& e = found_[i];
    if (j - i > 1) {
      out.inner.push_back({number(e.low), number(e.high)});
      continue;
    }
    const auto& t = e.triangle;
    BoundaryEdge boundary{number(e.up ? e.low : e.high), number(e.up ? e.high : e.low),
                          meshes::area_normal(position(t[0]), position(t[1]), position(t[2]))};
    (loose ? out.loose : out.edges).push_back(boundary);
  }
}

/// Half-edges between open vertices, the later of which is of the slab.
void BoundaryFinder::collect(const Triangles& triangles, const Slab& slab) {
  for (const auto& t : triangles) {
    std::array<bool, 3> candidate{};
    for (std::size_t k = 0; k < 3; ++k) candidate[k] = t[k] >= base_ && t[k] < slab.end() && open(t[k]);
    if (candidate[0] + candidate[1] + candidate[2] < 2) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = (k + 1) % 3;
      if (!candidate[k] || !candidate[next]) continue;
      HalfEdge e{std::min(t[k], t[next]), std::max(t[k], t[next]), t[k] < t[next], t};
      if (e.high >= slab.first) found_.push_back(e);
    }
  }
}

std::array<double, 3> BoundaryFinder::position(std::uint64_t vertex) const {
  for (const Slab& s : slabs_) {
    if (vertex < s.first || vertex >= s.end()) continue;
    const std::size_t i = vertex - s.first;
    return {s.vertices.x[i], s.vertices.y[i], s.vertices.z[i]};
  }
  throw Error(ExitCode::internal, "boundary: a triangle names a vertex that has gone");
}

void BoundaryFinder::put_vertices(const Slab& slab, BoundaryBatch& out) const {
  const VertexBatch& v = slab.vertices;
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (!open(slab.first + i)) continue;
    BoundaryVertex boundary;
    boundary.number = static_cast<Number>(slab.first + i) - static_cast<Number>(origin_);
    boundary.position = {v.x[i], v.y[i], v.z[i]};
    boundary.normal = v.fitted_normal(i);
    boundary.radius = v.radius.empty() ? 0 : v.radius[i];
    out.vertices.push_back(boundary);
    for (const auto& values : v.attributes) out.attributes.push_back(values[i]);
  }
}

void BoundaryFinder::finish(bool more, BoundaryBatch& out) {
  VertexBatch none;
  none.attributes.resize(slabs_[2].vertices.attributes.size());
  slide(none, {});
  settle(more || std::exchange(part_below_, false), out);
}

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
