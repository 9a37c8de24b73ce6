#include "isosurface/cell_emitter.h"

#include <algorithm>
#include <atomic>
#include <limits>

#include "isosurface/extract.h"

namespace lamina {
namespace {

Cell unit(int axis) {
  return {axis == 0, axis == 1, axis == 2};
}
Cell times(const Cell& c, std::int32_t f) {
  return {c.x * f, c.y * f, c.z * f};
}
Cell minus(const Cell& a, const Cell& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

/// Indices of this slab's tables seen from the slab below.
SlabIndex seen_from(SlabIndex vertex, SlabIndex corner) {
  return {corner.bits | (vertex.bits & SlabIndex::kNextSlab)};
}

bool any_crease(const std::vector<LoopSeat>& seats) {
  return std::any_of(seats.begin(), seats.end(), [](const LoopSeat& s) { return s.crease; });
}

float squared_distance(const std::array<float, 3>& a, const std::array<float, 3>& b) {
  const float x = a[0] - b[0];
  const float y = a[1] - b[1];
  const float z = a[2] - b[2];
  return x * x + y * y + z * z;
}

}  // namespace

void GeneralCell::resolve(int level, const Cell& cell) {
  level_ = level;
  cell_ = cell;
  tracer_.clear();
  crossings_.clear();
  for (int axis = 0; axis < 3; ++axis) {
    walk_face(level, axis, 0, cell);
    walk_face(level, axis, 1, cell + unit(axis));
  }
  tracer_.trace();
  std::sort(crossings_.begin(), crossings_.end(),
            [](const CellCrossing& a, const CellCrossing& b) { return a.key < b.key; });
  const auto same = [](const CellCrossing& a, const CellCrossing& b) { return a.key == b.key; };
  crossings_.erase(std::unique(crossings_.begin(), crossings_.end(), same), crossings_.end());
}

std::uint8_t GeneralCell::faces(const CellCrossing& c) const {
  unsigned mask = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<std::int32_t>((c.key >> (16 * axis)) & 0xFFFFU);
    if (at == 0) mask |= 1U << (2 * axis);
    if (at == 2 << level_) mask |= 2U << (2 * axis);
  }
  return static_cast<std::uint8_t>(mask);
}

/// A face, or a part of one, of the size of `level`'s cells; `low` is its lower corner. Its finest subdivision counts.
void GeneralCell::walk_face(int level, int axis, int end, const Cell& low) {
  const Cell u = unit((axis + 1) % 3);
  const Cell v = unit((axis + 2) % 3);
  const Cell across = end == 1 ? low : minus(low, unit(axis));
  if (level > 0 && cache_->test(level, across, &CornerBlock::split)) {
    const Cell child = times(low, 2);
    for (const Cell& quarter : {child, child + u, child + v, child + u + v}) walk_face(level - 1, axis, end, quarter);
    return;
  }
  cycle_.clear();
  known_ = true;
  for (const FaceSide& side : kFaceSides[end]) {
    const Cell offset = side.at == 0 ? Cell{} : (side.along == 0 ? v : u);
    walk_edge(level, (axis + 1 + side.along) % 3, low + offset, side.forward);
  }
  if (known_) {
    tracer_.add_face(cycle_);
  } else {
    tracer_.add_unresolved(cycle_);
  }
}

void GeneralCell::walk_edge(int level, int axis, const Cell& low, bool forward) {
  const Cell step = unit(axis);
  if (level > 0 && edge_is_divided(level, axis, low)) {
    const Cell first = times(low, 2);
    walk_edge(level - 1, axis, forward ? first : first + step, forward);
    walk_edge(level - 1, axis, forward ? first + step : first, forward);
    return;
  }
  const Cell high = low + step;
  if (!cache_->test(level, low, &CornerBlock::corners) || !cache_->test(level, high, &CornerBlock::corners)) {
    known_ = false;  // beside cells that take no part
    return;
  }
  const bool at_low = cache_->test(level, low, &CornerBlock::outside);
  const bool at_high = cache_->test(level, high, &CornerBlock::outside);
  if (at_low == at_high) return;
  const CornerBlock* block = cache_->block(level, low);
  if (!block->crossing[axis].test(offset_in_block(low))) {
    known_ = false;  // both ends belong to cells that take part, but the edge to none
    return;
  }
  Cell middle = minus(times(low, 2 << level), times(cell_, 2 << level_));
  middle = middle + times(step, 1 << level);
  const std::uint64_t key = loop_key(middle.x, middle.y, middle.z);
  crossings_.push_back({key, level, axis, low});
  cycle_.push_back({key, forward ? at_high : at_low});
}

bool GeneralCell::edge_is_divided(int level, int axis, const Cell& low) {
  const Cell u = unit((axis + 1) % 3);
  const Cell v = unit((axis + 2) % 3);
  return cache_->test(level, low, &CornerBlock::split) || cache_->test(level, minus(low, u), &CornerBlock::split) ||
         cache_->test(level, minus(low, v), &CornerBlock::split) ||
         cache_->test(level, minus(minus(low, u), v), &CornerBlock::split);
}

CellEmitter::Point CellEmitter::locate(const CellCrossing& c, const std::array<std::int32_t, 3>& origin) {
  const Lattice& lattice = cache_->window().lattice();
  const CornerBlock& block = *cache_->block(c.level, c.low);
  const int offset = offset_in_block(c.low);
  const int z = offset >> 6;
  Point p;
  p.accepted = block.accepted[c.axis].test(offset);
  if (!p.accepted) return p;
  std::uint32_t id = block.numbers[z].vertex_base;
  for (int a = 0; a < c.axis; ++a) id += static_cast<std::uint32_t>(std::popcount(block.accepted[a].words[z]));
  const std::uint64_t before = (std::uint64_t{1} << (offset & 63)) - 1;
  id += static_cast<std::uint32_t>(std::popcount(block.accepted[c.axis].words[z] & before));
  if (lattice.slab_of_layer(c.level, c.low.z) != slab_) id |= SlabIndex::kNextSlab;

  p.vertex.bits = id;
  p.geometry.faces = cell_.faces(c);
  const std::array<std::int32_t, 3> low = lattice.position(c.level, c.low);
  for (int i = 0; i < 3; ++i) p.geometry.position[i] = static_cast<float>(low[i] - origin[i]);
  p.geometry.position[c.axis] += vertex(p.vertex).t * static_cast<float>(lattice.cell_size(c.level));
  return p;
}

/// The cell's own quadrants around an edge: in the list of open ones, or out of it. Every quadrant is one cell's, so
/// the order of the cells does not matter.
void CellEmitter::note_quadrants(int level, const Cell& cell, const CellCrossing& c, SlabIndex i, bool covered) const {
  if (covered == (c.level == level)) return;  // numbering knows: open unless a cell of the edge's level takes part
  const int u = (c.axis + 1) % 3;
  const int v = (c.axis + 2) % 3;
  const std::array<std::int32_t, 3> low{c.low.x, c.low.y, c.low.z};
  const std::array<std::int32_t, 3> own{cell.x, cell.y, cell.z};
  constexpr std::array<std::array<int, 2>, 4> kBack = {{{1, 1}, {0, 1}, {0, 0}, {1, 0}}};
  const int shift = level - c.level;
  unsigned bits = 0;
  for (int q = 0; q < 4; ++q) {
    if (((low[u] - kBack[q][0]) >> shift) == own[u] && ((low[v] - kBack[q][1]) >> shift) == own[v]) bits |= 1U << q;
  }
  const std::atomic_ref<std::uint8_t> open(vertex(i).open);
  if (covered) {
    open.fetch_and(static_cast<std::uint8_t>(~bits), std::memory_order_relaxed);
  } else {
    open.fetch_or(static_cast<std::uint8_t>(bits), std::memory_order_relaxed);
  }
}

/// A point of the table of corners that comes close to the loop's mean: the nearest corner, and the one with which the
/// line between them passes nearest.
IsoVertex CellEmitter::centre(const std::array<std::int32_t, 3>& origin) const {
  struct End {
    SlabIndex corner;
    std::array<float, 3> position;
  };
  std::vector<End> ends;
  std::array<float, 3> mean{};
  for (const Point& p : loop_) {
    const IsoVertex& v = vertex(p.vertex);
    const IsoSlab& slab = p.vertex.next() ? *next_ : *here_;
    for (const SlabIndex i : {v.low, v.high}) {
      const SurfaceCorner& c = i.next() ? next_->corners[i.index()] : slab.corners[i.index()];
      End end{seen_from(p.vertex, i), {}};
      for (int k = 0; k < 3; ++k) end.position[k] = static_cast<float>(c.position[k] - origin[k]);
      ends.push_back(end);
    }
    for (int k = 0; k < 3; ++k) mean[k] += p.geometry.position[k] / static_cast<float>(loop_.size());
  }
  const End& near = *std::min_element(ends.begin(), ends.end(), [&](const End& a, const End& b) {
    return squared_distance(a.position, mean) < squared_distance(b.position, mean);
  });
  IsoVertex out;
  out.low = near.corner;
  out.axis = IsoVertex::kCentre;
  out.level = static_cast<std::uint8_t>(level_);
  float best = std::numeric_limits<float>::infinity();
  for (const End& far : ends) {
    if (far.corner == near.corner) continue;
    const float length = squared_distance(near.position, far.position);
    float dot = 0;
    for (int k = 0; k < 3; ++k) dot += (mean[k] - near.position[k]) * (far.position[k] - near.position[k]);
    const float t = std::clamp(dot / length, kEdgeMargin, 1.0F - kEdgeMargin);
    std::array<float, 3> at{};
    for (int k = 0; k < 3; ++k) at[k] = near.position[k] + t * (far.position[k] - near.position[k]);
    const float d = squared_distance(at, mean);
    if (d >= best) continue;
    best = d;
    out.high = far.corner;
    out.t = t;
  }
  out.near_high = out.t > 0.5F;
  return out;
}

/// Where a vertex goes with its cluster.
LoopSeat CellEmitter::seat(SlabIndex at, const std::array<std::int32_t, 3>& origin) const {
  const IsoVertex& v = vertex(at);
  const IsoSlab& slab = at.next() ? *next_ : *here_;
  const SlabIndex i = v.near_high ? v.high : v.low;
  const SurfaceCorner& c = i.next() ? next_->corners[i.index()] : slab.corners[i.index()];
  LoopSeat out;
  for (int k = 0; k < 3; ++k) out.position[k] = static_cast<float>(c.position[k] - origin[k]) + c.offset[k];
  out.normal = c.normal;
  out.crease = c.crease;
  return out;
}

/// Cuts `loop_` into triangles; false where no chords can.
bool CellEmitter::cut(const std::array<std::int32_t, 3>& origin) {
  outline_.clear();
  seats_.clear();
  cut_.clear();
  for (const Point& p : loop_) {
    outline_.push_back(p.geometry);
    seats_.push_back(seat(p.vertex, origin));
  }
  return any_crease(seats_) ? cut_loop_along_creases(outline_, seats_, cut_) : cut_loop(outline_, cut_);
}

/// The triangles of `loop_`.
void CellEmitter::emit_loop(const std::array<std::int32_t, 3>& origin, TriangleRun& run) {
  if (cut(origin)) {
    for (const auto& t : cut_) run.triangles.push_back({loop_[t[0]].vertex, loop_[t[1]].vertex, loop_[t[2]].vertex});
    return;
  }
  const SlabIndex middle{static_cast<std::uint32_t>(run.centres.size()) | TriangleRun::kCentre};
  run.centres.push_back(centre(origin));
  for (std::size_t i = 0; i < loop_.size(); ++i) {
    run.triangles.push_back({middle, loop_[i].vertex, loop_[(i + 1) % loop_.size()].vertex});
  }
}

bool CellEmitter::emit_creased(const PlainLoop& loop, TriangleRun& run) {
  if (loop.vertices.size() == 3) return false;  // one triangle either way
  const std::array<std::int32_t, 3> origin = cache_->window().lattice().position(loop.level, loop.cell);
  seats_.clear();
  for (const SlabIndex v : loop.vertices) seats_.push_back(seat(v, origin));
  cut_.clear();
  if (!any_crease(seats_) || !cut_loop_along_creases(loop.outline, seats_, cut_)) return false;
  for (const auto& t : cut_) run.triangles.push_back({loop.vertices[t[0]], loop.vertices[t[1]], loop.vertices[t[2]]});
  return true;
}

bool CellEmitter::emit(int level, const Cell& cell, TriangleRun& run) {
  level_ = level;
  cell_.resolve(level, cell);
  const std::vector<CellCrossing>& crossings = cell_.crossings();
  if (crossings.empty()) return false;
  const std::array<std::int32_t, 3> origin = cache_->window().lattice().position(level, cell);
  points_.clear();
  for (const CellCrossing& c : crossings) points_.push_back(locate(c, origin));
  const LoopTracer& tracer = cell_.tracer();
  for (const LoopTracer::Loop& loop : tracer.loops()) {
    loop_.clear();
    bool accepted = loop.closed;
    for (std::uint32_t i = 0; i < loop.count; ++i) {
      loop_.push_back(points_[tracer.order()[loop.first + i]]);
      accepted = accepted && loop_.back().accepted;
    }
    // Two vertices leave no surface in the cell: the neighbours across the two faces meet in the same line.
    for (std::uint32_t i = 0; i < loop.count; ++i) {
      const std::uint32_t at = tracer.order()[loop.first + i];
      if (points_[at].accepted) note_quadrants(level, cell, crossings[at], points_[at].vertex, accepted);
    }
    if (!accepted) {
      ++run.counts.rejected_loops;
    } else if (loop.count > 2) {
      emit_loop(origin, run);
    }
  }
  return true;
}

}  // namespace lamina
