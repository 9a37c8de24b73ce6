#include "octree/refine.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstring>
#include <limits>
#include <vector>

#include "base/four.h"
#include "lattice/lattice.h"

namespace lamina {
namespace {

/// Threads share words.
void set_bits(BlockMask& mask, int layer, std::uint64_t bits) {
  const std::atomic_ref<std::uint64_t> word(mask.words[static_cast<std::size_t>(layer)]);
  if ((word.load(std::memory_order_relaxed) & bits) != bits) word.fetch_or(bits, std::memory_order_relaxed);
}

typedef std::int16_t FourRows __attribute__((vector_size(8)));     // NOLINT(modernize-use-using)
typedef std::uint16_t EightRows __attribute__((vector_size(16)));  // NOLINT(modernize-use-using)
typedef std::uint8_t EightBytes __attribute__((vector_size(8)));   // NOLINT(modernize-use-using)

/// Four rows of 16 bits, from the lowest bits up.
using RowWord = std::uint64_t;

/// A sample as its cell sees it: all in cells, from the cell's low corner.
struct InCell {
  std::array<float, 3> point, normal;
  float radius, height;
};

/// Of the 4^3 corners around a cell, from one below its low corner on, those that a sample in the cell acts on: rows of
/// x, a word per layer. `kBounded`: no farther along its normal than its height.
template <bool kBounded>
std::array<RowWord, 4> corners_near(const InCell& sample) {
  const auto from_sample = [&](std::size_t axis) { return FourFloats{-1, 0, 1, 2} - sample.point[axis]; };
  const FourFloats dx = from_sample(0);
  const FourFloats dy = from_sample(1);
  const FourFloats dz = from_sample(2);
  const FourFloats x2 = dx * dx;
  const FourFloats y2 = dy * dy;
  const FourFloats up_x = dx * sample.normal[0];
  const FourFloats up_y = dy * sample.normal[1];
  const FourFloats up_z = dz * sample.normal[2];
  std::array<RowWord, 4> out;
  for (int z = 0; z < 4; ++z) {
    const FourFloats left = (sample.radius * sample.radius - dz[z] * dz[z]) - y2;  // a lane a row
    const FourFloats up = up_y + up_z[z];
    FourInts rows{};
    for (int x = 0; x < 4; ++x) {
      FourInts near = left > x2[x] + FourFloats{};
      if constexpr (kBounded) {
        const FourFloats height = up + up_x[x];
        near &= (height > -height ? height : -height) < FourFloats{} + sample.height;
      }
      rows |= near & (1 << x);
    }
    out[static_cast<std::size_t>(z)] = std::bit_cast<RowWord>(__builtin_convertvector(rows, FourRows));
  }
  return out;
}

/// Marks of one block's samples on their way into the window: without the other blocks' words and without other
/// threads.
class BlockMarks {
 public:
  void begin(int level, const Block& home) {
    level_ = level;
    home_ = home;
    cells_ = {};
    corners_ = {};
  }
  [[nodiscard]] bool holds(int level, const Block& home) const { return level == level_ && home == home_; }

  void mark_cell(int offset) { cells_[static_cast<std::size_t>(offset >> 6)] |= std::uint64_t{1} << (offset & 63); }
  /// The corners around a cell of the block, as of corners_near().
  void mark_corners(int offset, const std::array<RowWord, 4>& layers) {
    for (int k = 0; k < 4; ++k) {
      std::uint16_t* const rows =
          &corners_[static_cast<std::size_t>(((offset >> 6) + k) * kSide + ((offset >> 3) & 7))];
      RowWord four = 0;
      std::memcpy(&four, rows, sizeof(four));
      four |= layers[static_cast<std::size_t>(k)] << (offset & 7);
      std::memcpy(rows, &four, sizeof(four));
    }
  }

  void write_to(Window& window) const {
    if (level_ < 0) return;
    const std::array<Words, 9> words = words_of_blocks();
    // Blocks lie anywhere in memory: all are asked for before the first is written to.
    std::array<CornerBlock*, 27> to{};
    for (int i = 0; i < 27; ++i) {
      std::uint64_t any = 0;
      for (int z = first_layer(i / 9 - 1); z < end_layer(i / 9 - 1); ++z) any |= words[i % 9][z];
      if (any == 0) continue;
      to[i] = &window.touch_shared(level_, {home_.x + i % 3 - 1, home_.y + i / 3 % 3 - 1, home_.z + i / 9 - 1});
      ask_for(to[i]->acted_on);
    }
    CornerBlock& here = window.touch_shared(level_, home_);
    for (int z = 0; z < 8; ++z) set_bits(here.home, z, cells_[static_cast<std::size_t>(z)]);
    for (int i = 0; i < 27; ++i) {
      if (to[i] == nullptr) continue;
      const int dz = i / 9 - 1;
      for (int z = first_layer(dz); z < end_layer(dz); ++z) {
        if (words[i % 9][z] != 0) set_bits(to[i]->acted_on, z - 1 - 8 * dz, words[i % 9][z]);
      }
    }
  }

 private:
  static constexpr int kSide = 12;                 // from one corner below the block to three above its first beyond
  using Words = std::array<std::uint64_t, kSide>;  // a layer each

  /// The layers of the corners that lie in blocks so many above this one.
  static constexpr int first_layer(int dz) { return std::max(0, 1 + 8 * dz); }
  static constexpr int end_layer(int dz) { return std::min(kSide, 9 + 8 * dz); }

  /// Of eight rows the corners that lie in blocks dx beside this one.
  static std::uint64_t word_of(const std::uint16_t* rows, int dx) {
    EightRows eight;
    std::memcpy(&eight, rows, sizeof(eight));
    return std::bit_cast<std::uint64_t>(
        __builtin_convertvector(dx < 0 ? eight << 7 : eight >> (8 * dx + 1), EightBytes));
  }

  /// The corners as the nine blocks across the sweep axis have them, [y][x].
  [[nodiscard]] std::array<Words, 9> words_of_blocks() const {
    std::array<Words, 9> out;
    for (int z = 0; z < kSide; ++z) {
      const std::uint16_t* const rows = corners_.data() + z * kSide;
      for (int dx = -1; dx <= 1; ++dx) {
        out[1 + dx][z] = word_of(rows, dx) << 56;
        out[4 + dx][z] = word_of(rows + 1, dx);
        out[7 + dx][z] = word_of(rows + 9, dx) & 0xFFFFFF;
      }
    }
    return out;
  }

  int level_ = -1;
  Block home_;
  std::array<std::uint64_t, 8> cells_{};
  /// [z + 1][y + 1], bit x + 1; four rows are marked at once, eight read, of which five may lie behind the last.
  std::array<std::uint16_t, kSide * kSide + 5> corners_{};
};

}  // namespace

void mark_samples(Window& window, std::span<const Mark> marks) {
  std::vector<FloorDivider> cells;  // by level
  cells.reserve(static_cast<std::size_t>(window.levels()));
  for (int level = 0; level < window.levels(); ++level) cells.emplace_back(window.lattice().cell_size(level));
  // Of every level some, for samples of several lie among each other, and rows of blocks are gone through to and fro
  // where samples are in order by smaller ones.
  constexpr std::size_t kBlocks = 16;
  std::vector<BlockMarks> blocks(kBlocks * static_cast<std::size_t>(window.levels()));
  for (const Mark& m : marks) {
    const std::int32_t a = window.lattice().cell_size(m.level);
    const FloorDivider& cell_of = cells[m.level];
    const Cell cell{cell_of(m.x), cell_of(m.y), cell_of(m.z)};
    const Block home = block_of(cell);
    BlockMarks& block = blocks[kBlocks * m.level + static_cast<std::uint32_t>(home.x) % kBlocks];
    if (!block.holds(m.level, home)) {
      block.write_to(window);
      block.begin(m.level, home);
    }
    const float inv = 1.0F / static_cast<float>(a);
    const auto inside = [inv, a](std::int32_t v, std::int32_t low) {
      return static_cast<float>(std::int64_t{v} - std::int64_t{low} * a) * inv;
    };
    block.mark_cell(offset_in_block(cell));
    const InCell sample{{inside(m.x, cell.x), inside(m.y, cell.y), inside(m.z, cell.z)},
                        m.normal,
                        m.active_radius * inv,
                        m.active_height};
    const bool bounded = sample.height < std::numeric_limits<float>::infinity();
    block.mark_corners(offset_in_block(cell), bounded ? corners_near<true>(sample) : corners_near<false>(sample));
  }
  for (const BlockMarks& block : blocks) block.write_to(window);
}

}  // namespace lamina
