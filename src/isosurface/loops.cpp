#include "isosurface/loops.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lamina {
namespace {

/// Writes the triangles of the polygon i..j, whose best inner vertices `apex` holds.
void emit(const std::array<std::array<std::uint8_t, kMaxChordLoop>, kMaxChordLoop>& apex, std::uint8_t i,
          std::uint8_t j, std::vector<std::array<std::uint8_t, 3>>& triangles) {
  if (j - i < 2) return;
  const std::uint8_t k = apex[i][j];
  emit(apex, i, k, triangles);
  triangles.push_back({i, k, j});
  emit(apex, k, j, triangles);
}

float chord_length(const std::array<float, 3>& a, const std::array<float, 3>& b) {
  const float x = a[0] - b[0];
  const float y = a[1] - b[1];
  const float z = a[2] - b[2];
  return std::sqrt(x * x + y * y + z * z);
}

/// How much of a triangle's area, twice, faces away from the normals of its seats; those on a sharp edge do not count.
float turned_area(const LoopSeat& a, const LoopSeat& b, const LoopSeat& c) {
  std::array<float, 3> u;
  std::array<float, 3> v;
  for (std::size_t k = 0; k < 3; ++k) {
    u[k] = b.position[k] - a.position[k];
    v[k] = c.position[k] - a.position[k];
  }
  const std::array<float, 3> area{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  const float size = std::sqrt(area[0] * area[0] + area[1] * area[1] + area[2] * area[2]);
  float turned = 0;
  for (const LoopSeat* seat : {&a, &b, &c}) {
    if (seat->crease) continue;
    turned += size - (area[0] * seat->normal[0] + area[1] * seat->normal[1] + area[2] * seat->normal[2]);
  }
  return turned;
}

/// The triangulation of least cost, chords (i, j) and triangles (i, k, j), by dynamic programming; no chord may lie in
/// a face of the cell. False where there is none, or the loop is too long.
template <typename Chord, typename Across>
bool cut_cheapest(std::span<const LoopPoint> loop, const Chord& chord, const Across& across,
                  std::vector<std::array<std::uint8_t, 3>>& triangles) {
  const std::size_t n = loop.size();
  if (n > kMaxChordLoop) return false;
  constexpr float kForbidden = std::numeric_limits<float>::infinity();
  std::array<std::array<float, kMaxChordLoop>, kMaxChordLoop>
      cost;  // of cutting the polygon i..j, its own chord included
  std::array<std::array<std::uint8_t, kMaxChordLoop>, kMaxChordLoop> apex;
  for (std::size_t i = 0; i + 1 < n; ++i) cost[i][i + 1] = 0;
  for (std::size_t span = 2; span < n; ++span) {
    for (std::size_t i = 0; i + span < n; ++i) {
      const std::size_t j = i + span;
      cost[i][j] = kForbidden;
      const bool last = span + 1 == n;
      if (!last && (loop[i].faces & loop[j].faces) != 0) continue;
      const float own = last ? 0.0F : chord(i, j);
      for (std::size_t k = i + 1; k < j; ++k) {
        const float c = cost[i][k] + cost[k][j] + own + across(i, k, j);
        if (c < cost[i][j]) {
          cost[i][j] = c;
          apex[i][j] = static_cast<std::uint8_t>(k);
        }
      }
    }
  }
  if (cost[0][n - 1] == kForbidden) return false;
  emit(apex, 0, static_cast<std::uint8_t>(n - 1), triangles);
  return true;
}

std::uint64_t edge_key(int edge) {
  std::array<int, 3> middle = edge_low_corner(edge);
  for (int& c : middle) c *= 2;
  ++middle[edge / 4];
  return loop_key(middle[0], middle[1], middle[2]);
}

/// Edge of a cell by axis and the low corner's coordinates.
int edge_index(int axis, const std::array<int, 3>& low) {
  return axis * 4 + low[(axis + 1) % 3] + 2 * low[(axis + 2) % 3];
}

void walk_face(int outside, int axis, int end, LoopTracer& tracer) {
  std::vector<FaceCrossing> cycle;
  for (const FaceSide& side : kFaceSides[end]) {
    const int along = (axis + 1 + side.along) % 3;
    std::array<int, 3> low{};
    low[axis] = end;
    low[(axis + 2 - side.along) % 3] = side.at;
    const int corner = low[0] + 2 * low[1] + 4 * low[2];
    const bool at_low = ((outside >> corner) & 1) != 0;
    const bool at_high = ((outside >> (corner + (1 << along))) & 1) != 0;
    if (at_low != at_high) cycle.push_back({edge_key(edge_index(along, low)), side.forward ? at_high : at_low});
  }
  tracer.add_face(cycle);
}

CaseTriangles make_case(int outside) {
  LoopTracer tracer;
  for (int axis = 0; axis < 3; ++axis) {
    for (int end = 0; end < 2; ++end) walk_face(outside, axis, end, tracer);
  }
  tracer.trace();
  CaseTriangles out;
  std::ptrdiff_t first = 0;
  for (const LoopTracer::Loop& loop : tracer.loops()) {
    std::vector<LoopPoint> points;
    std::vector<int> edges;
    for (std::uint32_t i = 0; i < loop.count; ++i) {
      int edge = 0;
      while (edge_key(edge) != tracer.keys()[tracer.order()[loop.first + i]]) ++edge;
      edges.push_back(edge);
      points.push_back(edge_middle(edge));
    }
    std::copy(edges.begin(), edges.end(), out.loop_edges.begin() + first);
    first += static_cast<std::ptrdiff_t>(edges.size());
    out.loop_size.at(out.loops++) = static_cast<std::uint8_t>(edges.size());
    std::vector<std::array<std::uint8_t, 3>> triangles;
    cut_loop(points, triangles);  // always possible here
    for (const auto& t : triangles) {
      for (int i = 0; i < 3; ++i) out.edges.at(out.count * 3 + i) = static_cast<std::uint8_t>(edges[t[i]]);
      ++out.count;
    }
  }
  return out;
}

}  // namespace

LoopPoint edge_middle(int edge) {
  const std::array<int, 3> low = edge_low_corner(edge);
  LoopPoint p;
  for (int i = 0; i < 3; ++i) {
    p.position[i] = static_cast<float>(low[i]);
    if (i != edge / 4) p.faces |= static_cast<std::uint8_t>(1 << (2 * i + low[i]));
  }
  p.position[edge / 4] = 0.5F;
  return p;
}

void LoopTracer::clear() {
  keys_.clear();
  links_.clear();
  loops_.clear();
  order_.clear();
}

void LoopTracer::add_face(std::span<const FaceCrossing> cycle) {
  for (std::size_t i = 0; i < cycle.size(); ++i) {
    keys_.push_back(cycle[i].key);
    if (cycle[i].rising) links_.emplace_back(cycle[i + 1 == cycle.size() ? 0 : i + 1].key, cycle[i].key);
  }
}

void LoopTracer::add_unresolved(std::span<const FaceCrossing> cycle) {
  for (const FaceCrossing& c : cycle) keys_.push_back(c.key);
}

void LoopTracer::trace() {
  constexpr std::uint32_t kNone = ~std::uint32_t{0};
  std::sort(keys_.begin(), keys_.end());
  keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());
  const std::size_t n = keys_.size();
  next_.assign(n, kNone);
  has_previous_.assign(n, 0);
  visited_.assign(n, 0);
  const auto index = [&](std::uint64_t key) {
    return static_cast<std::uint32_t>(std::lower_bound(keys_.begin(), keys_.end(), key) - keys_.begin());
  };
  for (const auto& [from, to] : links_) {
    const std::uint32_t target = index(to);
    next_[index(from)] = target;
    has_previous_[target] = 1;
  }
  const auto follow = [&](std::uint32_t start, bool closed) {
    Loop loop{static_cast<std::uint32_t>(order_.size()), 0, closed};
    for (std::uint32_t i = start; i != kNone && visited_[i] == 0; i = next_[i]) {
      visited_[i] = 1;
      order_.push_back(i);
      ++loop.count;
    }
    loops_.push_back(loop);
  };
  for (std::uint32_t i = 0; i < n; ++i) {
    if (has_previous_[i] == 0) follow(i, false);
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    if (visited_[i] == 0) follow(i, true);
  }
}

bool cut_loop(std::span<const LoopPoint> loop, std::vector<std::array<std::uint8_t, 3>>& triangles) {
  if (loop.size() == 3) {
    triangles.push_back({0, 1, 2});
    return true;
  }
  return cut_cheapest(
      loop, [&](std::size_t i, std::size_t j) { return chord_length(loop[i].position, loop[j].position); },
      [](std::size_t, std::size_t, std::size_t) { return 0.0F; }, triangles);
}

bool cut_loop_along_creases(std::span<const LoopPoint> loop, std::span<const LoopSeat> seats,
                            std::vector<std::array<std::uint8_t, 3>>& triangles) {
  if (loop.size() == 3) {
    triangles.push_back({0, 1, 2});
    return true;
  }
  // Chords decide where triangles do not: in planes, and where seats are clustered into one.
  constexpr float kChordShare = 1e-3F;
  float largest = 0;
  for (std::size_t i = 1; i < seats.size(); ++i)
    largest = std::max(largest, chord_length(seats[0].position, seats[i].position));
  return cut_cheapest(
      loop,
      [&](std::size_t i, std::size_t j) {
        return kChordShare * largest * chord_length(seats[i].position, seats[j].position);
      },
      [&](std::size_t i, std::size_t k, std::size_t j) { return turned_area(seats[i], seats[k], seats[j]); },
      triangles);
}

const std::array<CaseTriangles, 256>& case_table() {
  static const std::array<CaseTriangles, 256> table = [] {
    std::array<CaseTriangles, 256> t;
    for (int i = 0; i < 256; ++i) t[i] = make_case(i);
    return t;
  }();
  return table;
}

}  // namespace lamina
