// Finer cells where two sheets of a surface lie closer than a cell, by what the samples' normals say.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "base/hashing.h"
#include "lattice/lattice.h"
#include "store/slab_store.h"

namespace lamina {

/// Numbers for cells of several levels: a hash table whose keys lie in it, so that most look-ups read nothing else.
/// Indices of forgotten cells are used again.
class CellTable {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  /// Index of a cell, kNone where there is none. Safe from several threads while nothing is added.
  [[nodiscard]] std::uint32_t find(const Cell& at, std::uint8_t level) const {
    return slots_[slot_of(at, level)].index;
  }

  struct Touched {
    std::uint32_t index = kNone;
    bool is_new = false;
  };
  /// Index of a cell, made if absent. Where that takes room, the cells that keep(cell, level) lets go are forgotten.
  template <typename Keep>
  Touched touch(const Cell& at, std::uint8_t level, const Keep& keep) {
    std::size_t slot = slot_of(at, level);
    if (slots_[slot].index != kNone) return {slots_[slot].index, false};
    if (2 * (size_ - free_.size() + 1) > slots_.size()) {
      rehash(keep);
      slot = slot_of(at, level);
    }
    if (free_.empty()) free_.push_back(static_cast<std::uint32_t>(size_++));
    const std::uint32_t index = free_.back();
    free_.pop_back();
    slots_[slot] = {at, index, level};
    return {index, true};
  }
  /// Indices are less than this.
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  struct Slot {
    Cell at;
    std::uint32_t index = kNone;
    std::uint8_t level = 0;
  };
  /// Where a cell is or would be.
  [[nodiscard]] std::size_t slot_of(const Cell& at, std::uint8_t level) const {
    std::size_t slot = cell_hash(at.x, at.y, at.z + (std::int64_t{level} << 32)) & (slots_.size() - 1);
    while (slots_[slot].index != kNone && (slots_[slot].at != at || slots_[slot].level != level))
      slot = (slot + 1) & (slots_.size() - 1);
    return slot;
  }
  /// Makes room until the table is at most a quarter full.
  template <typename Keep>
  void rehash(const Keep& keep) {
    std::vector<Slot> kept;
    kept.reserve(slots_.size() / 2);
    for (const Slot& slot : slots_) {
      if (slot.index == kNone) continue;
      if (keep(slot.at, slot.level)) {
        kept.push_back(slot);
      } else {
        free_.push_back(slot.index);
      }
    }
    std::size_t size = slots_.size();
    while (4 * (kept.size() + 1) > size) size *= 2;
    slots_.assign(size, {});
    for (const Slot& slot : kept) slots_[slot_of(slot.at, slot.level)] = slot;
  }

  std::vector<Slot> slots_ = std::vector<Slot>(64);  ///< a power of two, at most half full
  std::vector<std::uint32_t> free_;
  std::size_t size_ = 0;
};

/// Normals cancel where their sum is shorter than this share of their number. One sheet that turns by a right angle has
/// 0.7, two that face each other next to none, or what one of them has more.
inline constexpr double kCancelledShare = 0.5;

/// A sample takes a level less where the normals in the 27 cells of its level around it cancel: two sheets lie there
/// closer than a cell, or one turns sharply, and neither comes out well in cells of that size. Cells hold the samples
/// of their own level; those of the finest level and those left out count nowhere.
///
/// Slides along z: buckets are pushed as they ascend and popped once all samples around theirs are known. The result is
/// a function of the samples and their levels alone, not of how they are cut into buckets or ordered. Keeps four bytes
/// for each sample not popped, and the cells around.
class SheetRefinement {
 public:
  explicit SheetRefinement(const Lattice& lattice);
  /// The next bucket's samples with the levels they ask for; `support` 0: left out.
  void push(const LocalSamples& samples, const std::vector<std::uint8_t>& level, const std::vector<float>& support);
  /// Which samples of the next pushed bucket take a level less: 1 for them, else 0. False while samples around them may
  /// be missing: all those below `pushed_below` have been pushed.
  bool pop(std::int64_t pushed_below, std::vector<std::uint8_t>& finer);

 private:
  static constexpr std::uint32_t kNone = CellTable::kNone;
  /// The samples in a cell. Sums of integers do not depend on their order; of more than 2^22 samples they wrap, and say
  /// nothing.
  struct CellNormals {
    std::uint32_t x = 0, y = 0, z = 0;  ///< sum of the normals, in units of 1 / kUnit, two's complement
    std::uint32_t samples = 0;
  };
  /// Cells along a side of a block: what surrounds all of its cells is found by 27 look-ups.
  static constexpr int kSide = 4;
  static constexpr int kSideBits = 2;
  static constexpr int kCells = kSide * kSide * kSide;
  static constexpr std::uint32_t index_in_block(int x, int y, int z) {
    return static_cast<std::uint32_t>((z * kSide + y) * kSide + x);
  }
  /// Directions that a normal lies near, a bit each. Normals that share one do not cancel, whatever sums are made.
  using Directions = std::uint16_t;
  static constexpr auto kAllDirections = static_cast<Directions>(~0U);
  static Directions directions_near(float x, float y, float z);
  /// Blocks along a side of a district: where the normals of the districts around a block share a direction, as they do
  /// nearly everywhere, they need not be looked at block by block.
  static constexpr int kDistrictBits = 2;
  /// Cells of a level.
  struct Block {
    Cell at;  ///< coordinates of its cells, divided by kSide
    std::uint8_t level = 0;
    std::array<CellNormals, kCells> cells{};
  };
  /// What is known of a block's cells, a bit each.
  struct Findings {
    std::uint64_t wanted = 0, decided = 0, finer = 0;
    Directions shared = kAllDirections;  ///< all normals in the block lie near these
    std::uint32_t district = kNone;
  };
  struct WaitingBucket {
    std::vector<std::uint32_t> cell_of;  ///< of each sample: index of its block * kCells + cell; kNone: does not count
    std::int64_t low = std::numeric_limits<std::int64_t>::max();   ///< least z of the samples that count
    std::int64_t high = std::numeric_limits<std::int64_t>::min();  ///< upper end of the cells around them
  };
  /// A block among successive samples.
  struct Visit {
    Cell block;
    std::uint8_t level;
    std::uint32_t index;
  };
  static constexpr std::uint32_t kShares = 16;  ///< of the blocks: each is filled by one thread
  /// Successive samples of a bucket that is pushed, [begin, end).
  struct Piece {
    std::size_t begin = 0, end = 0;
    std::vector<Visit> visits;
    std::vector<std::uint16_t> by_share;  ///< samples that count, from `begin`; those of a share follow one another
    std::array<std::uint16_t, kShares + 1> share_begin{};
    std::int64_t low = std::numeric_limits<std::int64_t>::max();   ///< as of WaitingBucket
    std::int64_t high = std::numeric_limits<std::int64_t>::min();  ///< likewise
  };

  void list_blocks(const LocalSamples& samples, const std::vector<std::uint8_t>& level,
                   const std::vector<float>& support, WaitingBucket& bucket, Piece& piece) const;
  static void give_indices(WaitingBucket& bucket, Piece& piece);
  void add(const LocalSamples& samples, const WaitingBucket& bucket, std::span<const std::uint16_t> of,
           std::size_t begin);
  [[nodiscard]] bool is_needed(const Cell& at, int cells, std::uint8_t level) const;
  std::uint32_t touch(const Cell& block, std::uint8_t level);
  [[nodiscard]] Directions shared_around(const Block& block) const;
  using Around = std::array<std::uint32_t, 27>;  ///< indices of blocks, kNone where there is none
  void decide(std::uint32_t own);
  [[nodiscard]] std::uint64_t cancelling(std::uint64_t wanted, const Around& around) const;

  Lattice lattice_;
  std::vector<FloorDivider> to_cell_;           ///< by level
  std::vector<std::unique_ptr<Block>> blocks_;  ///< a block keeps its index until it is forgotten
  std::vector<Findings> findings_;              ///< by block: most of the work reads these alone
  std::vector<Directions> districts_;           ///< what all normals in a district lie near
  CellTable block_table_, district_table_;
  std::int64_t needed_from_ = std::numeric_limits<std::int64_t>::min();  ///< z of samples still to be judged
  std::deque<WaitingBucket> waiting_;
};

}  // namespace lamina
