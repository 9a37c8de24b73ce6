#include "samples/sheet_refinement.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
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

std::size_t SheetRefinement::slot_of(const Cell& block, std::uint8_t level) const {
  std::size_t at = cell_hash(block.x, block.y, block.z + (std::int64_t{level} << 32)) & (slots_.size() - 1);
  while (slots_[at] != kNone && (blocks_[slots_[at]].at != block || blocks_[slots_[at]].level != level))
    at = (at + 1) & (slots_.size() - 1);
  return at;
}

std::uint32_t SheetRefinement::touch(const Cell& block, std::uint8_t level) {
  std::size_t slot = slot_of(block, level);
  if (slots_[slot] != kNone) return slots_[slot];
  if (2 * (blocks_.size() - free_.size() + 1) > slots_.size()) {
    rehash();
    slot = slot_of(block, level);
  }
  if (free_.empty()) {
    slots_[slot] = static_cast<std::uint32_t>(blocks_.size());
    blocks_.emplace_back();
  } else {
    slots_[slot] = free_.back();
    free_.pop_back();
    blocks_[slots_[slot]] = {};
  }
  blocks_[slots_[slot]].at = block;
  blocks_[slots_[slot]].level = level;
  return slots_[slot];
}

/// Forgets the blocks that nothing depends on any more, and makes room until the table is at most a quarter full.
void SheetRefinement::rehash() {
  std::vector<std::uint32_t> kept;
  kept.reserve(slots_.size() / 2);
  for (const std::uint32_t index : slots_) {
    if (index == kNone) continue;
    const Block& b = blocks_[index];
    const std::int64_t first_needed = cell_row(needed_from_, lattice_.cell_size(b.level)) - 1;
    (2 * std::int64_t{b.at.z} + 1 < first_needed ? free_ : kept).push_back(index);
  }
  std::size_t size = slots_.size();
  while (4 * (kept.size() + 1) > size) size *= 2;
  slots_.assign(size, kNone);
  for (const std::uint32_t index : kept) slots_[slot_of(blocks_[index].at, blocks_[index].level)] = index;
}

void SheetRefinement::push(const LocalSamples& samples, const std::vector<std::uint8_t>& level,
                           const std::vector<float>& support) {
  WaitingBucket& bucket = waiting_.emplace_back();
  bucket.cell_of.assign(samples.size(), kNone);
  std::uint32_t index = kNone;  // of the last sample's block: successive samples lie close to each other
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!(support[i] > 0) || level[i] == 0) continue;
    const FloorDivider& to_cell = to_cell_[level[i]];
    const Cell cell{to_cell(samples.x[i]), to_cell(samples.y[i]), to_cell(samples.z[i])};
    const Cell block{cell.x >> 1, cell.y >> 1, cell.z >> 1};
    if (index == kNone || blocks_[index].level != level[i] || blocks_[index].at != block)
      index = touch(block, level[i]);
    const auto in_block = static_cast<std::uint32_t>((cell.z & 1) << 2 | (cell.y & 1) << 1 | (cell.x & 1));
    CellNormals& c = blocks_[index].cells[in_block];
    ++c.samples;
    c.x += in_units(samples.nx[i]);
    c.y += in_units(samples.ny[i]);
    c.z += in_units(samples.nz[i]);
    bucket.cell_of[i] = index * 8 + in_block;
    bucket.low = std::min(bucket.low, std::int64_t{samples.z[i]});
    bucket.high = std::max(bucket.high, (std::int64_t{cell.z} + 2) * lattice_.cell_size(level[i]));
  }
}

/// Of the cells wanted.
void SheetRefinement::decide(Block& block) const {
  static constexpr std::array<CellNormals, 8> kEmpty{};
  std::array<const CellNormals*, 27> around{};
  for (int k = 0; k < 27; ++k) {
    const std::uint32_t index = slots_[slot_of(block.at + Cell{k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1}, block.level)];
    around[static_cast<std::size_t>(k)] = index == kNone ? kEmpty.data() : blocks_[index].cells.data();
  }
  for (unsigned bits = block.wanted; bits != 0; bits &= bits - 1) {
    const int cell = std::countr_zero(bits);
    CellNormals sum;
    for (int k = 0; k < 27; ++k) {
      // Counted from the lower end of the block below.
      const int x = (cell & 1) + k % 3 + 1, y = (cell >> 1 & 1) + k / 3 % 3 + 1, z = (cell >> 2) + k / 9 + 1;
      const CellNormals& c = around[static_cast<std::size_t>((z >> 1) * 9 + (y >> 1) * 3 + (x >> 1))]
                                   [(z & 1) << 2 | (y & 1) << 1 | (x & 1)];
      sum.x += c.x;
      sum.y += c.y;
      sum.z += c.z;
      sum.samples += c.samples;
    }
    const auto square = [](std::int64_t v) { return static_cast<double>(v) * static_cast<double>(v); };
    const double limit = kCancelledShare * kUnit * static_cast<double>(sum.samples);
    if (square(sum.x) + square(sum.y) + square(sum.z) < limit * limit)
      block.finer = static_cast<std::uint8_t>(block.finer | 1U << cell);
  }
  block.decided |= block.wanted;
  block.wanted = 0;
}

bool SheetRefinement::pop(std::int64_t pushed_below, std::vector<bool>& finer) {
  if (waiting_.empty() || waiting_.front().high > pushed_below) return false;
  const WaitingBucket bucket = std::move(waiting_.front());
  waiting_.pop_front();
  std::vector<std::uint32_t> undecided;
  for (const std::uint32_t cell : bucket.cell_of) {
    if (cell == kNone) continue;
    Block& block = blocks_[cell / 8];
    const unsigned bit = 1U << cell % 8;
    if (((block.decided | block.wanted) & bit) != 0) continue;
    if (block.wanted == 0) undecided.push_back(cell / 8);
    block.wanted = static_cast<std::uint8_t>(block.wanted | bit);
  }
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, undecided.size(), 256), [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) decide(blocks_[undecided[k]]);
  });
  finer.assign(bucket.cell_of.size(), false);
  for (std::size_t i = 0; i < finer.size(); ++i) {
    const std::uint32_t cell = bucket.cell_of[i];
    finer[i] = cell != kNone && (blocks_[cell / 8].finer >> cell % 8 & 1U) != 0;
  }
  needed_from_ = pushed_below;
  for (const WaitingBucket& w : waiting_) needed_from_ = std::min(needed_from_, w.low);
  return true;
}

}  // namespace lamina
