// The counting octree of a window: samples are counted in its finest cells, radii come out for the same cells.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "samples/cell_blocks.h"
#include "samples/radii.h"

namespace lamina {

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
