// Finer cells where two sheets of a surface lie closer than a cell, by what the samples' normals say.
#pragma once
#include <array>
#include <cstdint>
#include <deque>
#include <limits>
#include <vector>

#include "lattice/lattice.h"
#include "samples/cell_table.h"
#include "store/slab_store.h"

namespace lamina {

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
  /// Which samples of the next pushed bucket take a level less. False while samples around them may be missing: all
  /// those below `pushed_below` have been pushed.
  bool pop(std::int64_t pushed_below, std::vector<bool>& finer);

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
  [[nodiscard]] bool is_needed(const Cell& at, int cells, std::uint8_t level) const;
  std::uint32_t touch(const Cell& block, std::uint8_t level);
  [[nodiscard]] Directions shared_around(const Block& block) const;
  using Around = std::array<std::uint32_t, 27>;  ///< indices of blocks, kNone where there is none
  void decide(std::uint32_t own);
  [[nodiscard]] std::uint64_t cancelling(std::uint64_t wanted, const Around& around) const;

  Lattice lattice_;
  std::vector<FloorDivider> to_cell_;  ///< by level
  std::deque<Block> blocks_;           ///< a block keeps its index until it is forgotten
  std::vector<Findings> findings_;     ///< by block: most of the work reads these alone
  std::vector<Directions> districts_;  ///< what all normals in a district lie near
  CellTable block_table_, district_table_;
  std::int64_t needed_from_ = std::numeric_limits<std::int64_t>::min();  ///< z of samples still to be judged
  std::deque<WaitingBucket> waiting_;
};

}  // namespace lamina
