#include "samples/sheet_refinement.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <utility>

#include "base/four.h"

namespace lamina {
namespace {

/// Normals are summed in units of 1 / kUnit: far finer than what is asked of the sums.
constexpr double kUnit = 1 << 9;

std::int64_t cell_row(std::int64_t z, std::int64_t side) {
  return z / side - static_cast<std::int64_t>(z % side < 0);
}

}  // namespace

SheetRefinement::SheetRefinement(const Lattice& lattice) : lattice_(lattice) {
  for (int level = 0; level < lattice.levels; ++level) to_cell_.emplace_back(lattice.cell_size(level));
}

/// Whether samples still to be judged lie in or beside a cube of so many cells a side.
bool SheetRefinement::is_needed(const Cell& at, int cells, std::uint8_t level) const {
  const std::int64_t first_needed = cell_row(needed_from_, lattice_.cell_size(level)) - 1;
  return cells * (std::int64_t{at.z} + 1) > first_needed;
}

std::uint32_t SheetRefinement::touch(const Cell& block, std::uint8_t level) {
  const auto [index, is_new] =
      block_table_.touch(block, level, [this](const Cell& at, std::uint8_t l) { return is_needed(at, kSide, l); });
  if (!is_new) return index;
  if (index == blocks_.size()) {
    blocks_.push_back(std::make_unique<Block>());
    findings_.emplace_back();
  } else {
    *blocks_[index] = {};
  }
  blocks_[index]->at = block;
  blocks_[index]->level = level;
  const Cell cell{block.x >> kDistrictBits, block.y >> kDistrictBits, block.z >> kDistrictBits};
  const auto district = district_table_.touch(
      cell, level, [this](const Cell& at, std::uint8_t l) { return is_needed(at, kSide << kDistrictBits, l); });
  districts_.resize(district_table_.size(), kAllDirections);
  if (district.is_new) districts_[district.index] = kAllDirections;
  findings_[index] = {};
  findings_[index].district = district.index;
  return index;
}

/// The normals near a direction lie within 59 degrees of it, so that any sum of them is longer than kCancelledShare of
/// their number, with room for rounding. A cube's faces and corners: one of them is within 37 degrees of any normal.
SheetRefinement::Directions SheetRefinement::directions_near(float x, float y, float z) {
  constexpr auto kNear = static_cast<float>(kCancelledShare + 0.015);
  constexpr float kNearCorner = std::numbers::sqrt3_v<float> * kNear;
  const auto near = [](const FourFloats& along, float least) {
    return bits_of(along > FourFloats{} + least) | bits_of(along < FourFloats{} - least) << 4;
  };
  const FourFloats faces{x, y, z, 0};
  const FourFloats corners = FourFloats{x, x, x, x} + FourFloats{y, y, -y, -y} + FourFloats{z, -z, z, -z};
  return static_cast<Directions>(near(faces, kNear) | near(corners, kNearCorner) << 8);
}

void SheetRefinement::push(const LocalSamples& samples, const std::vector<std::uint8_t>& level,
                           const std::vector<float>& support) {
  WaitingBucket& bucket = waiting_.emplace_back();
  bucket.cell_of.resize(samples.size());
  // Which blocks there are is found by all threads, their indices by one, and what lies in them by all again.
  std::vector<Piece> pieces((samples.size() + kSampleGrain - 1) / kSampleGrain);
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    pieces[p].begin = p * kSampleGrain;
    pieces[p].end = std::min(samples.size(), pieces[p].begin + kSampleGrain);
  }
  const auto for_pieces = [&](const auto& use) {
    tbb::parallel_for(std::size_t{0}, pieces.size(), [&](std::size_t p) { use(pieces[p]); });
  };
  for_pieces([&](Piece& piece) { list_blocks(samples, level, support, bucket, piece); });
  for (Piece& piece : pieces) {
    for (Visit& visit : piece.visits) visit.index = touch(visit.block, visit.level);
    bucket.low = std::min(bucket.low, piece.low);
    bucket.high = std::max(bucket.high, piece.high);
  }
  for_pieces([&](Piece& piece) { give_indices(bucket, piece); });
  tbb::parallel_for(std::uint32_t{0}, kShares, [&](std::uint32_t share) {
    for (const Piece& piece : pieces) {
      const std::uint16_t first = piece.share_begin[share];
      add(samples, bucket, std::span(piece.by_share).subspan(first, piece.share_begin[share + 1] - first), piece.begin);
    }
  });
}

/// The blocks of a piece's samples; until these have indices, cells count from the piece's list of them.
void SheetRefinement::list_blocks(const LocalSamples& samples, const std::vector<std::uint8_t>& level,
                                  const std::vector<float>& support, WaitingBucket& bucket, Piece& piece) const {
  // Of the last sample's block, by level: successive samples lie close to each other.
  std::vector<std::uint32_t> last(to_cell_.size(), kNone);
  for (std::size_t i = piece.begin; i < piece.end; ++i) {
    bucket.cell_of[i] = kNone;
    if (!(support[i] > 0) || level[i] == 0) continue;
    const FloorDivider& to_cell = to_cell_[level[i]];
    const Cell cell{to_cell(samples.x[i]), to_cell(samples.y[i]), to_cell(samples.z[i])};
    const Cell block{cell.x >> kSideBits, cell.y >> kSideBits, cell.z >> kSideBits};
    std::uint32_t& visit = last[level[i]];
    if (visit == kNone || piece.visits[visit].block != block) {
      visit = static_cast<std::uint32_t>(piece.visits.size());
      piece.visits.push_back({block, level[i], kNone});
    }
    constexpr int kLast = kSide - 1;
    bucket.cell_of[i] = visit * kCells + index_in_block(cell.x & kLast, cell.y & kLast, cell.z & kLast);
    piece.low = std::min(piece.low, std::int64_t{samples.z[i]});
    piece.high = std::max(piece.high, (std::int64_t{cell.z} + 2) * lattice_.cell_size(level[i]));
  }
}

/// What the piece's samples have of the list's blocks becomes the blocks' own; samples are put in order by share, which
/// has every kShares-th block.
void SheetRefinement::give_indices(WaitingBucket& bucket, Piece& piece) {
  static_assert(kSampleGrain <= std::numeric_limits<std::uint16_t>::max());
  std::array<std::uint16_t, kShares + 1>& begin = piece.share_begin;
  const auto share_of = [](std::uint32_t cell) { return cell / kCells % kShares; };
  for (std::size_t i = piece.begin; i < piece.end; ++i) {
    std::uint32_t& cell = bucket.cell_of[i];
    if (cell == kNone) continue;
    cell = piece.visits[cell / kCells].index * kCells + cell % kCells;
    ++begin[share_of(cell) + 1];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  piece.by_share.resize(begin.back());
  auto next = begin;
  for (std::size_t i = piece.begin; i < piece.end; ++i) {
    const std::uint32_t cell = bucket.cell_of[i];
    if (cell != kNone) piece.by_share[next[share_of(cell)]++] = static_cast<std::uint16_t>(i - piece.begin);
  }
}

/// Samples of one share, whose blocks no other thread adds to, each `begin` and one of the numbers.
void SheetRefinement::add(const LocalSamples& samples, const WaitingBucket& bucket, std::span<const std::uint16_t> of,
                          std::size_t begin) {
  const auto cell_at = [&](std::size_t k) { return bucket.cell_of[begin + of[k]]; };
  constexpr std::size_t kAhead = 8;  // samples: their cells lie anywhere in memory
  for (std::size_t k = 0; k < of.size(); ++k) {
    if (k + kAhead < of.size()) {
      const std::uint32_t later = cell_at(k + kAhead);
      __builtin_prefetch(&blocks_[later / kCells]->cells[later % kCells]);
    }
    const std::size_t i = begin + of[k];
    const std::uint32_t cell = cell_at(k);
    Findings& findings = findings_[cell / kCells];
    if (const Directions near = directions_near(samples.nx[i], samples.ny[i], samples.nz[i]);
        (findings.shared & ~near) != 0) {
      findings.shared &= near;
      std::atomic_ref(districts_[findings.district]).fetch_and(near, std::memory_order_relaxed);
    }
    CellNormals& c = blocks_[cell / kCells]->cells[cell % kCells];
    const FourFloats normal{samples.nx[i], samples.ny[i], samples.nz[i], 0};
    const FourInts units = rounded(normal * static_cast<float>(kUnit));
    c.x += static_cast<std::uint32_t>(units[0]);
    c.y += static_cast<std::uint32_t>(units[1]);
    c.z += static_cast<std::uint32_t>(units[2]);
    ++c.samples;
  }
}

/// What the normals in the districts of a block and of the blocks around it share.
SheetRefinement::Directions SheetRefinement::shared_around(const Block& block) const {
  const auto beside = [](std::int32_t at) { return std::pair{(at - 1) >> kDistrictBits, (at + 1) >> kDistrictBits}; };
  const auto [x_begin, x_end] = beside(block.at.x);
  const auto [y_begin, y_end] = beside(block.at.y);
  const auto [z_begin, z_end] = beside(block.at.z);
  Directions shared = kAllDirections;
  for (std::int32_t z = z_begin; z <= z_end; ++z) {
    for (std::int32_t y = y_begin; y <= y_end; ++y) {
      for (std::int32_t x = x_begin; x <= x_end; ++x) {
        const std::uint32_t district = district_table_.find({x, y, z}, block.level);
        if (district != kNone) shared &= districts_[district];
      }
    }
  }
  return shared;
}

/// Of the cells wanted.
void SheetRefinement::decide(std::uint32_t own) {
  const Block& block = *blocks_[own];
  Findings& findings = findings_[own];
  const std::uint64_t wanted = std::exchange(findings.wanted, 0);
  findings.decided |= wanted;
  if (shared_around(block) != 0) return;
  Around around{};
  around.fill(kNone);
  around[13] = own;
  Directions shared = findings.shared;
  for (int k = 0; k < 27; ++k) {
    const Cell at = block.at + Cell{k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
    const std::uint32_t index = k == 13 ? kNone : block_table_.find(at, block.level);
    if (index == kNone) continue;
    around[static_cast<std::size_t>(k)] = index;
    shared &= findings_[index].shared;
  }
  if (shared == 0) findings.finer |= cancelling(wanted, around);
}

/// Those of a block's cells around which normals cancel.
std::uint64_t SheetRefinement::cancelling(std::uint64_t wanted, const Around& around) const {
  // The block and one cell around it, dense.
  constexpr int kRow = kSide + 2;
  std::array<CellNormals, static_cast<std::size_t>(kRow * kRow * kRow)> field{};
  const auto in_field = [](int x, int y, int z) {
    return static_cast<std::size_t>(((z + 1) * kRow + y + 1) * kRow + x + 1);
  };
  /// Cells of the block `d` blocks away, along one axis, that are in the field.
  const auto range = [](int d) {
    return d < 0 ? std::pair{kSide - 1, kSide} : d > 0 ? std::pair{0, 1} : std::pair{0, kSide};
  };
  for (int k = 0; k < 27; ++k) {
    const std::uint32_t index = around[static_cast<std::size_t>(k)];
    if (index == kNone) continue;
    const int dx = k % 3 - 1;
    const int dy = k / 3 % 3 - 1;
    const int dz = k / 9 - 1;
    const auto [x_begin, x_end] = range(dx);
    const auto [y_begin, y_end] = range(dy);
    const auto [z_begin, z_end] = range(dz);
    for (int z = z_begin; z < z_end; ++z) {
      for (int y = y_begin; y < y_end; ++y) {
        const CellNormals* const row = &blocks_[index]->cells[index_in_block(x_begin, y, z)];
        std::copy(row, row + (x_end - x_begin), &field[in_field(dx * kSide + x_begin, dy * kSide + y, dz * kSide + z)]);
      }
    }
  }
  std::uint64_t out = 0;
  for (std::uint64_t bits = wanted; bits != 0; bits &= bits - 1) {
    const int cell = std::countr_zero(bits);
    const int x = cell % kSide;
    const int y = cell / kSide % kSide;
    const int z = cell / (kSide * kSide);
    CellNormals sum;
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        const CellNormals* const row = &field[in_field(x - 1, y + dy, z + dz)];
        for (int i = 0; i < 3; ++i) {
          sum.x += row[i].x;
          sum.y += row[i].y;
          sum.z += row[i].z;
          sum.samples += row[i].samples;
        }
      }
    }
    const auto square = [](std::uint32_t v) {
      const auto whole = static_cast<double>(static_cast<std::int32_t>(v));
      return whole * whole;
    };
    const double limit = kCancelledShare * kUnit * static_cast<double>(sum.samples);
    if (square(sum.x) + square(sum.y) + square(sum.z) < limit * limit) out |= std::uint64_t{1} << cell;
  }
  return out;
}

bool SheetRefinement::pop(std::int64_t pushed_below, std::vector<std::uint8_t>& finer) {
  if (waiting_.empty() || waiting_.front().high > pushed_below) return false;
  const WaitingBucket bucket = std::move(waiting_.front());
  waiting_.pop_front();
  tbb::enumerable_thread_specific<std::vector<std::uint32_t>> found;
  const tbb::blocked_range<std::size_t> samples(0, bucket.cell_of.size(), kSampleGrain);
  tbb::parallel_for(samples, [&](const auto& range) {
    std::vector<std::uint32_t>& blocks = found.local();
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const std::uint32_t cell = bucket.cell_of[i];
      if (cell == kNone) continue;
      Findings& block = findings_[cell / kCells];
      const std::uint64_t bit = std::uint64_t{1} << cell % kCells;
      const std::atomic_ref<std::uint64_t> wanted(block.wanted);
      if (((block.decided | wanted.load(std::memory_order_relaxed)) & bit) != 0) continue;
      if (wanted.fetch_or(bit, std::memory_order_relaxed) == 0) blocks.push_back(cell / kCells);
    }
  });
  std::vector<std::uint32_t> undecided;
  for (const auto& blocks : found) undecided.insert(undecided.end(), blocks.begin(), blocks.end());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, undecided.size(), 64), [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) decide(undecided[k]);
  });
  finer.resize(bucket.cell_of.size());
  tbb::parallel_for(samples, [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const std::uint32_t cell = bucket.cell_of[i];
      finer[i] = cell != kNone && (findings_[cell / kCells].finer >> cell % kCells & 1U) != 0 ? 1 : 0;
    }
  });
  needed_from_ = pushed_below;
  for (const WaitingBucket& w : waiting_) needed_from_ = std::min(needed_from_, w.low);
  return true;
}

}  // namespace lamina
