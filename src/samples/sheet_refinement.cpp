#include "samples/sheet_refinement.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "base/hashing.h"

namespace lamina {
namespace {

/// Normals are summed in units of 1 / kUnit: finer than they are measured, and a cell may hold 2^43 of them.
constexpr double kUnit = 1 << 20;

std::int64_t in_units(float v) {
  return std::llrint(static_cast<double>(v) * kUnit);
}

std::int64_t cell_row(std::int64_t z, std::int64_t side) {
  return z / side - static_cast<std::int64_t>(z % side < 0);
}

}  // namespace

SheetRefinement::SheetRefinement(const Lattice& lattice) : lattice_(lattice) {
  for (int level = 0; level < lattice.levels; ++level) to_cell_.emplace_back(lattice.cell_size(level));
}

std::size_t SheetRefinement::slot_of(const Cell& cell, std::uint8_t level) const {
  std::size_t at = cell_hash(cell.x, cell.y, cell.z + (std::int64_t{level} << 32)) & (slots_.size() - 1);
  while (slots_[at] != kNone && (cells_[slots_[at]].cell != cell || cells_[slots_[at]].level != level))
    at = (at + 1) & (slots_.size() - 1);
  return at;
}

std::uint32_t SheetRefinement::touch(const Cell& cell, std::uint8_t level) {
  std::size_t slot = slot_of(cell, level);
  if (slots_[slot] != kNone) return slots_[slot];
  if (2 * (cells_.size() - free_.size() + 1) > slots_.size()) {
    rehash();
    slot = slot_of(cell, level);
  }
  if (free_.empty()) {
    slots_[slot] = static_cast<std::uint32_t>(cells_.size());
    cells_.emplace_back();
  } else {
    slots_[slot] = free_.back();
    free_.pop_back();
  }
  cells_[slots_[slot]] = {cell, level};
  return slots_[slot];
}

/// Forgets the cells that nothing depends on any more, and makes room until the table is at most a quarter full.
void SheetRefinement::rehash() {
  std::vector<std::uint32_t> kept;
  kept.reserve(slots_.size() / 2);
  for (const std::uint32_t index : slots_) {
    if (index == kNone) continue;
    const CellNormals& c = cells_[index];
    const std::int64_t first_needed = cell_row(needed_from_, lattice_.cell_size(c.level)) - 1;
    (c.cell.z < first_needed ? free_ : kept).push_back(index);
  }
  std::size_t size = slots_.size();
  while (4 * (kept.size() + 1) > size) size *= 2;
  slots_.assign(size, kNone);
  for (const std::uint32_t index : kept) slots_[slot_of(cells_[index].cell, cells_[index].level)] = index;
}

void SheetRefinement::push(const LocalSamples& samples, const std::vector<std::uint8_t>& level,
                           const std::vector<float>& support) {
  WaitingBucket& bucket = waiting_.emplace_back();
  bucket.cell_of.assign(samples.size(), kNone);
  std::uint32_t index = kNone;  // of the last sample's cell: successive samples lie close to each other
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!(support[i] > 0) || level[i] == 0) continue;
    const FloorDivider& to_cell = to_cell_[level[i]];
    const Cell cell{to_cell(samples.x[i]), to_cell(samples.y[i]), to_cell(samples.z[i])};
    if (index == kNone || cells_[index].level != level[i] || cells_[index].cell != cell) index = touch(cell, level[i]);
    CellNormals& c = cells_[index];
    ++c.samples;
    c.x += in_units(samples.nx[i]);
    c.y += in_units(samples.ny[i]);
    c.z += in_units(samples.nz[i]);
    bucket.cell_of[i] = index;
    bucket.low = std::min(bucket.low, std::int64_t{samples.z[i]});
    bucket.high = std::max(bucket.high, (std::int64_t{cell.z} + 2) * lattice_.cell_size(level[i]));
  }
}

bool SheetRefinement::cancels_around(const CellNormals& middle) const {
  std::int64_t x = 0, y = 0, z = 0, samples = 0;
  for (int i = 0; i < 27; ++i) {
    const std::uint32_t index = slots_[slot_of(middle.cell + Cell{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1}, middle.level)];
    if (index == kNone) continue;
    const CellNormals& c = cells_[index];
    x += c.x;
    y += c.y;
    z += c.z;
    samples += c.samples;
  }
  const auto square = [](std::int64_t v) { return static_cast<double>(v) * static_cast<double>(v); };
  const double limit = kCancelledShare * kUnit * static_cast<double>(samples);
  return square(x) + square(y) + square(z) < limit * limit;
}

bool SheetRefinement::pop(std::int64_t pushed_below, std::vector<bool>& finer) {
  if (waiting_.empty() || waiting_.front().high > pushed_below) return false;
  const WaitingBucket bucket = std::move(waiting_.front());
  waiting_.pop_front();
  std::vector<std::uint32_t> undecided;
  for (const std::uint32_t index : bucket.cell_of) {
    if (index == kNone || cells_[index].verdict != Verdict::open) continue;
    cells_[index].verdict = Verdict::pending;
    undecided.push_back(index);
  }
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, undecided.size(), 1024), [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      CellNormals& c = cells_[undecided[k]];
      c.verdict = cancels_around(c) ? Verdict::finer : Verdict::stays;
    }
  });
  finer.assign(bucket.cell_of.size(), false);
  for (std::size_t i = 0; i < finer.size(); ++i) {
    const std::uint32_t index = bucket.cell_of[i];
    finer[i] = index != kNone && cells_[index].verdict == Verdict::finer;
  }
  needed_from_ = pushed_below;
  for (const WaitingBucket& w : waiting_) needed_from_ = std::min(needed_from_, w.low);
  return true;
}

}  // namespace lamina
