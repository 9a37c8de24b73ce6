#include "samples/cell_octree.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include "lamina/error.h"

namespace lamina {
namespace {

std::size_t hash(const BlockKey& key) {
  const auto word = [](std::int32_t v) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(v)); };
  std::uint64_t h = (word(key.x) | word(key.y) << 32) * 0x9E3779B97F4A7C15U;
  h = (h ^ (h >> 32) ^ word(key.z)) * 0xD6E8FEB86659FD93U;
  return static_cast<std::size_t>(h ^ (h >> 32));
}

}  // namespace

std::size_t CellBlocks::slot_of(const BlockKey& key) const {
  const std::size_t mask = slots_.size() - 1;
  std::size_t slot = hash(key) & mask;
  while (slots_[slot].block != kNone && !(slots_[slot].key == key)) slot = (slot + 1) & mask;
  return slot;
}

std::uint32_t CellBlocks::find(const BlockKey& key) const {
  return slots_[slot_of(key)].block;
}

std::uint32_t CellBlocks::insert(const BlockKey& key) {
  std::size_t slot = slot_of(key);
  if (slots_[slot].block != kNone) return slots_[slot].block;
  if (2 * (blocks_.size() - free_.size() + 1) > slots_.size()) {
    rebuild(2 * slots_.size());
    slot = slot_of(key);
  }
  std::uint32_t block = 0;
  if (free_.empty()) {
    block = static_cast<std::uint32_t>(blocks_.size());
    blocks_.emplace_back();
  } else {
    block = free_.back();
    free_.pop_back();
    blocks_[block] = {};
  }
  blocks_[block].key = key;
  slots_[slot] = {key, block};
  layers_[key.z].push_back(block);
  return block;
}

std::vector<std::uint32_t> CellBlocks::between(std::int64_t z_begin, std::int64_t z_end) const {
  std::vector<std::uint32_t> found;
  for (const auto& [z, layer] : layers_) {
    const std::int64_t low = static_cast<std::int64_t>(z) * kBlockSide;
    if (low < z_end && low + kBlockSide > z_begin) found.insert(found.end(), layer.begin(), layer.end());
  }
  return found;
}

void CellBlocks::drop_below(std::int64_t z_end) {
  bool dropped = false;
  while (!layers_.empty() && (static_cast<std::int64_t>(layers_.begin()->first) + 1) * kBlockSide <= z_end) {
    const auto& layer = layers_.begin()->second;
    for (const std::uint32_t block : layer) blocks_[block].radii.reset();
    free_.insert(free_.end(), layer.begin(), layer.end());
    layers_.erase(layers_.begin());
    dropped = true;
  }
  if (dropped) rebuild(slots_.size());
}

void CellBlocks::rebuild(std::size_t slots) {
  slots_.assign(slots, {});
  for (const auto& [z, layer] : layers_) {
    for (const std::uint32_t block : layer) slots_[slot_of(blocks_[block].key)] = {blocks_[block].key, block};
  }
}

namespace {

/// Samples counted by one task.
constexpr std::size_t kChunk = 2048;

constexpr int kHalo = kBlockSide + 2;
/// A block's cells with one more on every side.
using HaloCounts = std::array<std::uint32_t, kHalo * kHalo * kHalo>;

constexpr std::size_t halo_index(int x, int y, int z) {  // of cells -1 .. kBlockSide
  return static_cast<std::size_t>(((z + 1) * kHalo + y + 1) * kHalo + x + 1);
}

/// Layers of a block whose z lies in [z_begin, z_end).
struct Layers {
  Layers(const CellBlock& block, std::int64_t z_begin, std::int64_t z_end) {
    const std::int64_t low = static_cast<std::int64_t>(block.key.z) * kBlockSide;
    begin = static_cast<int>(std::clamp<std::int64_t>(z_begin - low, 0, kBlockSide));
    end = static_cast<int>(std::clamp<std::int64_t>(z_end - low, 0, kBlockSide));
  }
  int begin, end;
};

constexpr int kLayer = kBlockSide * kBlockSide;

/// The cells with samples in those layers.
std::uint64_t occupied_cells(const CellBlock& block, Layers layers) {
  std::uint64_t cells = 0;
  for (int z = layers.begin; z < layers.end; ++z) {
    std::uint64_t layer = 0;
    for (int i = 0; i < kLayer; ++i) {
      layer |= static_cast<std::uint64_t>(block.counts[static_cast<std::size_t>(z * kLayer + i)] != 0) << i;
    }
    cells |= layer << (z * kLayer);
  }
  return cells;
}

/// Remembers the blocks looked up last: successive samples of a bucket lie close to each other.
class RecentBlocks {
 public:
  explicit RecentBlocks(const CellBlocks& blocks) : blocks_(blocks) {}
  /// Index of a block, kNone when there is none; `unseen` hears of every such block, of some more than once.
  template <class Unseen>
  std::uint32_t find(const BlockKey& key, Unseen&& unseen) {
    Entry& entry = entries_[static_cast<std::size_t>((key.x & 7) | (key.y & 7) << 3 | (key.z & 1) << 6)];
    if (!entry.filled || !(entry.key == key)) {
      entry = {key, blocks_.find(key), true};
      if (entry.block == CellBlocks::kNone) unseen(key);
    }
    return entry.block;
  }

 private:
  struct Entry {
    BlockKey key;
    std::uint32_t block = CellBlocks::kNone;
    bool filled = false;
  };
  const CellBlocks& blocks_;
  std::array<Entry, 128> entries_{};
};

template <class F>
void for_each_bit(std::uint64_t bits, F&& f) {
  for (; bits != 0; bits &= bits - 1) f(static_cast<std::uint32_t>(std::countr_zero(bits)));
}

/// The cells of a block that touch a neighbour of it at d (-1, 0, 1) along an axis: all when it lies beside the block.
constexpr std::uint64_t cells_towards(int dx, int dy, int dz) {
  std::uint64_t cells = ~std::uint64_t{0};
  if (dx != 0) cells &= 0x1111'1111'1111'1111U << (dx > 0 ? kBlockSide - 1 : 0);
  if (dy != 0) cells &= 0x000F'000F'000F'000FU << (dy > 0 ? kBlockSide * (kBlockSide - 1) : 0);
  if (dz != 0) cells &= std::uint64_t{0xFFFF} << (dz > 0 ? kLayer * (kBlockSide - 1) : 0);
  return cells;
}

/// Counts of the cells that bound the radii of `cells` and their neighbours, zero for all others; false when there are
/// none. Left out is what none of `cells` touches. Notes whether a block around has refined cells.
bool bounding_counts(const CellBlocks& level, CellBlock& block, std::uint64_t cells, HaloCounts& halo) {
  bool any = false;
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if ((cells & cells_towards(dx, dy, dz)) == 0) continue;
        const std::uint32_t index = level.find({block.key.x + dx, block.key.y + dy, block.key.z + dz});
        if (index == CellBlocks::kNone) continue;
        const CellBlock& from = level[index];
        block.refined_around = block.refined_around || from.refined != 0;
        const std::uint64_t touching = from.bounding & cells_towards(-dx, -dy, -dz);
        if (touching == 0) continue;
        if (!std::exchange(any, true)) halo.fill(0);
        for_each_bit(touching, [&](std::uint32_t cell) {
          halo[halo_index(cell_x(cell) + dx * kBlockSide, cell_y(cell) + dy * kBlockSide,
                          cell_z(cell) + dz * kBlockSide)] = from.counts[cell];
        });
      }
    }
  }
  return any;
}

/// Replaces the value of every inner cell by the largest of the 27 around it, one axis after the other.
void spread_maximum(HaloCounts& halo) {
  HaloCounts other;
  const auto along = [](const HaloCounts& from, std::size_t stride, HaloCounts& to) {
    for (std::size_t i = stride; i + stride < from.size(); ++i) {
      to[i] = std::max(from[i], std::max(from[i - stride], from[i + stride]));
    }
  };
  other = halo;
  along(halo, 1, other);
  along(other, kHalo, halo);
  other = halo;
  along(halo, std::size_t{kHalo} * kHalo, other);
  halo = other;
}

}  // namespace

CellOctree::CellOctree(const RadiiSettings& settings)
    : settings_(settings), levels_(static_cast<std::size_t>(settings.levels)) {}

CellOctree::ZRange CellOctree::cells_of(std::int64_t begin, std::int64_t end, int level) const {
  const int shift = group_shift() - level;
  return {begin * (std::int64_t{1} << shift), end * (std::int64_t{1} << shift)};
}

void CellOctree::count(std::span<const std::int32_t> x, std::span<const std::int32_t> y,
                       std::span<const std::int32_t> z, std::span<CellRef> refs) {
  CellBlocks& finest = levels_[0];
  const std::size_t n = x.size();
  const std::size_t chunks = (n + kChunk - 1) / kChunk;
  const auto key = [&](std::size_t i) { return BlockKey{x[i] >> kBlockLog2, y[i] >> kBlockLog2, z[i] >> kBlockLog2}; };
  std::vector<std::vector<BlockKey>> missing(chunks);
  std::vector<std::uint8_t> complete(chunks, 0);
  const auto look_up = [&](std::size_t chunk, bool first) {
    RecentBlocks recent(finest);
    const std::size_t end = std::min(n, (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      const std::uint32_t block = recent.find(key(i), [&](const BlockKey& k) { missing[chunk].push_back(k); });
      refs[i] = block * kBlockCells + cell_in_block(x[i], y[i], z[i]);
    }
    complete[chunk] = static_cast<std::uint8_t>(!first || missing[chunk].empty());
  };
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) { look_up(chunk, true); });
  for (const auto& keys : missing) {
    for (const auto& k : keys) {
      if (finest.insert(k) >= std::numeric_limits<CellRef>::max() / kBlockCells) {
        throw Error(ExitCode::budget, "radii: too many counting cells in the window; raise the finest cell size");
      }
    }
  }
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
    if (complete[chunk] == 0) look_up(chunk, false);
  });
  // By one thread: a nanosecond each, where counters shared by threads would take five.
  for (const CellRef ref : refs) ++finest[ref / kBlockCells].counts[ref % kBlockCells];
}

void CellOctree::aggregate(std::int64_t begin, std::int64_t end) {
  for (int level = 0; level < settings_.levels; ++level) {
    const ZRange range = cells_of(begin, end, level);
    CellBlocks& fine = levels_[static_cast<std::size_t>(level)];
    for (const std::uint32_t index : fine.between(range.begin, range.end)) aggregate_block(level, index, range);
  }
}

void CellOctree::aggregate_block(int level, std::uint32_t index, ZRange range) {
  CellBlock& from = levels_[static_cast<std::size_t>(level)][index];
  const Layers layers(from, range.begin, range.end);
  // Columns of two cells first, then squares of four of these: the eight children of each parent.
  constexpr int half = kBlockSide / 2;
  std::array<std::array<std::uint32_t, kLayer>, half> sums{}, most{};
  for (int z = layers.begin; z < layers.end; ++z) {
    const std::uint32_t* const counts = from.counts.data() + z * kLayer;
    auto& sum = sums[static_cast<std::size_t>(z / 2)];
    auto& top = most[static_cast<std::size_t>(z / 2)];
    for (std::size_t i = 0; i < kLayer; ++i) {
      sum[i] += counts[i];
      top[i] = std::max(top[i], counts[i]);
    }
  }
  const std::uint32_t enough = is_coarsest(level) ? 1 : settings_.min_samples;
  std::uint32_t greatest = 0;
  for (const auto& layer : most) greatest = std::max(greatest, *std::max_element(layer.begin(), layer.end()));
  if (greatest >= enough) {
    from.enough = true;
    for_each_bit(occupied_cells(from, layers) & ~from.refined, [&](std::uint32_t cell) {
      if (from.counts[cell] >= enough) from.bounding |= std::uint64_t{1} << cell;
    });
  }
  if (is_coarsest(level)) return;
  CellBlocks& coarse = levels_[static_cast<std::size_t>(level) + 1];
  if (from.parent == CellBlock::kNone) from.parent = coarse.insert(parent_key(from.key));
  CellBlock& to = coarse[from.parent];
  const std::uint32_t first = parent_cell(from.key, 0);
  for (std::size_t z = 0; z < half; ++z) {
    for (std::size_t y = 0; y < half; ++y) {
      for (std::size_t x = 0; x < half; ++x) {
        const std::size_t i = 2 * y * kBlockSide + 2 * x;
        const auto parent = first + static_cast<std::uint32_t>((z * kBlockSide + y) * kBlockSide + x);
        to.counts[parent] += sums[z][i] + sums[z][i + 1] + sums[z][i + kBlockSide] + sums[z][i + kBlockSide + 1];
        const std::uint32_t top = std::max(std::max(most[z][i], most[z][i + 1]),
                                           std::max(most[z][i + kBlockSide], most[z][i + kBlockSide + 1]));
        if (top >= settings_.min_samples) to.refined |= std::uint64_t{1} << parent;
      }
    }
  }
}

void CellOctree::find_radii(std::int64_t begin, std::int64_t end) {
  for (int level = settings_.levels - 1; level >= 0; --level) {
    const ZRange range = cells_of(begin, end, level);
    const auto blocks = levels_[static_cast<std::size_t>(level)].between(range.begin, range.end);
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t i) { find_block_radii(level, blocks[i], range); });
  }
}

// The paper's radius of a sample, 2 sqrt(A / N) of the finest cell around it that holds enough samples, is far too long
// in cells that the surface merely clips. It is bounded by the radii of neighbours, where
// - a neighbour's radius is the one its own count gives, 2 sqrt(A / N): the bound of a cell is a maximum of counts;
// - neighbours with fewer than enough samples say nothing (nor could they: their radius would be longer than that of
//   any cell with enough), except at the coarsest level, where every count is taken for what it is;
// - neighbours that are refined further, having a child with enough samples, do not bound at this level but through
//   their children, and so only the samples close to these. Otherwise a step in density would shorten the radii of the
//   sparse side over the width of one of its own cells, and open a crack there: on a plane whose halves differ 64 times
//   in density, 11 % of the sparse half's samples got less than half their radius, against 2.6 % like this;
// - for the same reason samples are bounded at every level from the finest up to the one their radius comes from: those
//   of a clipped cell lie against the cells it was clipped from, whose finest levels tell the density there. What is
//   left are radii up to 1.7 times twice the spacing on uniform planes and spheres, where unbounded ones reached 18 and
//   48, and up to 3.4 times in single cells along a step in density.
void CellOctree::find_block_radii(int level, std::uint32_t index, ZRange range) {
  CellBlocks& blocks = levels_[static_cast<std::size_t>(level)];
  CellBlock& block = blocks[index];
  const CellBlock* parents = is_coarsest(level) ? nullptr : &levels_[static_cast<std::size_t>(level) + 1][block.parent];
  const std::uint32_t enough = parents == nullptr ? 1 : settings_.min_samples;
  // A cell that could bound here has a refined parent. Most blocks of the finest levels have none around, and every
  // cell of theirs has its parent's radius.
  const bool may_be_bounded = parents == nullptr || parents->refined_around;
  if (!may_be_bounded && !block.enough) return;
  const std::uint64_t cells = occupied_cells(block, Layers(block, range.begin, range.end));
  HaloCounts bounding;
  const bool bounded = may_be_bounded && bounding_counts(blocks, block, cells, bounding);
  if (!bounded && !block.enough) return;
  if (bounded) spread_maximum(bounding);
  const double diameter = 2.0 * settings_.finest_cell * static_cast<double>(std::int64_t{1} << level);
  const auto radius_of = [&](std::uint32_t count) {
    return static_cast<float>(diameter / std::sqrt(static_cast<double>(count)));
  };
  for_each_bit(cells, [&](std::uint32_t cell) {
    const std::uint32_t count = block.counts[cell];
    const std::uint32_t most = bounded ? bounding[halo_index(cell_x(cell), cell_y(cell), cell_z(cell))] : 0;
    if (count < enough && most == 0) return;
    float radius = count >= enough
                       ? radius_of(count)
                       : this->radius(static_cast<std::size_t>(level) + 1, block.parent, parent_cell(block.key, cell));
    if (most > 0) radius = std::min(radius, settings_.neighbour_bound * radius_of(most));
    if (!block.radii) block.radii = std::make_unique<Radii>();
    (*block.radii)[cell] = radius;
    block.own |= std::uint64_t{1} << cell;
  });
}

float CellOctree::radius(std::size_t level, std::uint32_t block, std::uint32_t cell) const {
  // The coarsest level has a radius for every cell with samples.
  for (;; ++level) {
    const CellBlock& b = levels_[level][block];
    if ((b.own >> cell & 1U) != 0 || level + 1 == levels_.size()) return b.radii ? (*b.radii)[cell] : 0.0F;
    cell = parent_cell(b.key, cell);
    block = b.parent;
  }
}

void CellOctree::drop_below(std::int64_t group) {
  for (int level = 0; level < settings_.levels; ++level) {
    levels_[static_cast<std::size_t>(level)].drop_below(cells_of(group, group, level).begin);
  }
}

}  // namespace lamina
