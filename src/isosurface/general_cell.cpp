#include "isosurface/general_cell.h"

#include <algorithm>

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

}  // namespace lamina
