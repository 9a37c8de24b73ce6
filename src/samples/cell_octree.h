// The counting octree of a window: samples are counted in its finest cells, radii come out for the same cells. Each
// level is sparse: blocks of 4^3 cells found through a hash table, dropped behind the sweep.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "samples/radius_estimator.h"

namespace lamina {

inline constexpr int kBlockLog2 = 2;  ///< small blocks: sparse regions have few samples in each
inline constexpr int kBlockSide = 1 << kBlockLog2;
inline constexpr std::uint32_t kBlockCells = kBlockSide * kBlockSide * kBlockSide;

/// Position of a block in units of blocks: the cell's shifted right.
struct BlockKey {
  std::int32_t x = 0, y = 0, z = 0;
  bool operator==(const BlockKey&) const = default;
};

/// Cell of a block: z outermost, so that a slice is contiguous.
constexpr std::uint32_t cell_in_block(std::int32_t x, std::int32_t y, std::int32_t z) {
  constexpr std::int32_t mask = kBlockSide - 1;
  return static_cast<std::uint32_t>(((z & mask) << (2 * kBlockLog2)) | ((y & mask) << kBlockLog2) | (x & mask));
}

constexpr int cell_x(std::uint32_t cell) {
  return static_cast<int>(cell % kBlockSide);
}
constexpr int cell_y(std::uint32_t cell) {
  return static_cast<int>(cell / kBlockSide % kBlockSide);
}
constexpr int cell_z(std::uint32_t cell) {
  return static_cast<int>(cell / (kBlockSide * kBlockSide));
}

/// The block one level up that holds a block, and the cell there that holds one of its cells.
constexpr BlockKey parent_key(const BlockKey& key) {
  return {key.x >> 1, key.y >> 1, key.z >> 1};
}
constexpr std::uint32_t parent_cell(const BlockKey& key, std::uint32_t cell) {
  constexpr int half = kBlockSide / 2;
  return cell_in_block((key.x & 1) * half + cell_x(cell) / 2, (key.y & 1) * half + cell_y(cell) / 2,
                       (key.z & 1) * half + cell_z(cell) / 2);
}

using Radii = std::array<float, kBlockCells>;

struct CellBlock {
  static constexpr std::uint32_t kNone = ~0U;

  BlockKey key;
  std::uint32_t parent = kNone;  ///< block one level up, once aggregated
  std::uint64_t refined = 0;     ///< bit per cell: a child holds enough samples to stand for itself
  std::uint64_t bounding = 0;    ///< bit per cell: holds enough samples to bound the radii around, and is not refined
  std::uint64_t own = 0;         ///< bit per cell: `radii` is final; the others have their parent cell's radius
  bool enough = false;           ///< a cell holds enough samples
  bool refined_around = false;   ///< one of the 27 blocks here has refined cells
  std::unique_ptr<Radii> radii;  ///< only where a cell has one of its own: few do in the finest levels
  std::array<std::uint32_t, kBlockCells> counts{};
};
static_assert(kBlockCells == 64, "refined and own have one bit per cell");

/// Blocks keep their index until they are dropped; indices are reused.
class CellBlocks {
 public:
  static constexpr std::uint32_t kNone = CellBlock::kNone;

  /// Index of a block, kNone when there is none; safe from several threads while nothing is inserted.
  [[nodiscard]] std::uint32_t find(const BlockKey& key) const;
  /// Index of a block, made with zero counts when there is none.
  std::uint32_t insert(const BlockKey& key);
  [[nodiscard]] CellBlock& operator[](std::uint32_t index) { return blocks_[index]; }
  [[nodiscard]] const CellBlock& operator[](std::uint32_t index) const { return blocks_[index]; }
  /// Indices of all blocks that hold cells with z in [z_begin, z_end).
  [[nodiscard]] std::vector<std::uint32_t> between(std::int64_t z_begin, std::int64_t z_end) const;
  /// Drops the blocks all of whose cells have z < z_end.
  void drop_below(std::int64_t z_end);

 private:
  struct Slot {
    BlockKey key;
    std::uint32_t block = kNone;
  };
  [[nodiscard]] std::size_t slot_of(const BlockKey& key) const;  ///< where the key is or would be
  void rebuild(std::size_t slots);

  std::vector<CellBlock> blocks_;
  std::vector<std::uint32_t> free_;
  std::vector<Slot> slots_ = std::vector<Slot>(64);            ///< a power of two, at most half full
  std::map<std::int32_t, std::vector<std::uint32_t>> layers_;  ///< block indices by key.z
};

/// A finest cell: block * kBlockCells + cell in the block.
using CellRef = std::uint32_t;

/// Works along z in groups: a group is as high as a coarsest cell, so no cell straddles two.
class CellOctree {
 public:
  explicit CellOctree(const RadiiSettings& settings);
  /// Shift from a finest cell's z to its group.
  [[nodiscard]] int group_shift() const { return settings_.levels - 1; }

  /// Counts samples given by their finest cells and writes where each was counted: fastest where successive samples lie
  /// close to each other. Throws Error(budget) when the window
  /// holds more blocks than a CellRef can name.
  void count(std::span<const std::int32_t> x, std::span<const std::int32_t> y, std::span<const std::int32_t> z,
             std::span<CellRef> refs);
  /// Sums the counts of groups [begin, end) up to the coarser levels; all their samples have been counted.
  void aggregate(std::int64_t begin, std::int64_t end);
  /// Radii of groups [begin, end); they and the groups begin - 1 and end have been aggregated.
  void find_radii(std::int64_t begin, std::int64_t end);
  [[nodiscard]] float radius(CellRef ref) const { return radius(0, ref / kBlockCells, ref % kBlockCells); }
  /// Forgets the groups before `group`.
  void drop_below(std::int64_t group);

 private:
  struct ZRange {
    std::int64_t begin, end;
  };
  [[nodiscard]] bool is_coarsest(int level) const { return level + 1 == settings_.levels; }
  [[nodiscard]] ZRange cells_of(std::int64_t begin, std::int64_t end, int level) const;
  void aggregate_block(int level, std::uint32_t index, ZRange range);
  void find_block_radii(int level, std::uint32_t index, ZRange range);
  /// The radius of a cell: its own, else the nearest one above.
  [[nodiscard]] float radius(std::size_t level, std::uint32_t block, std::uint32_t cell) const;

  RadiiSettings settings_;
  std::vector<CellBlocks> levels_;  ///< finest first
};

}  // namespace lamina
