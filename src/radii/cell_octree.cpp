#include "radii/cell_octree.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "lamina/error.h"

namespace lamina {
namespace {

/// Samples counted by one task.
constexpr std::size_t kChunk = 8192;

constexpr int kHalo = kBlockSide + 2;
/// A block's cells with one more on every side.
using HaloCounts = std::array<std::uint32_t, kHalo * kHalo * kHalo>;

constexpr std::size_t halo_index(int x, int y, int z) {  // of cells -1 .. kBlockSide
  return static_cast<std::size_t>(((z + 1) * kHalo + y + 1) * kHalo + x + 1);
}

/// The cells with samples whose z lies in [z_begin, z_end).
std::uint64_t occupied_cells(const CellBlock& block, std::int64_t z_begin, std::int64_t z_end) {
  std::uint64_t cells = 0;
  for (std::uint32_t cell = 0; cell < kBlockCells; ++cell) {
    cells |= static_cast<std::uint64_t>(block.counts[cell] != 0) << cell;
  }
  constexpr int slice = kBlockSide * kBlockSide;
  for (int z = 0; z < kBlockSide; ++z) {
    const std::int64_t at = static_cast<std::int64_t>(block.key.z) * kBlockSide + z;
    if (at < z_begin || at >= z_end) cells &= ~(std::uint64_t{0xFFFF} << z * slice);
  }
  return cells;
}

template <class F>
void for_each_bit(std::uint64_t bits, F&& f) {
  for (; bits != 0; bits &= bits - 1) f(static_cast<std::uint32_t>(std::countr_zero(bits)));
}

/// Which sides of their block cells (as a bit set) touch.
struct Sides {
  explicit Sides(std::uint64_t cells) {
    constexpr std::uint64_t x_low = 0x1111'1111'1111'1111U, y_low = 0x000F'000F'000F'000FU, z_low = 0xFFFFU;
    x = {(cells & x_low) != 0, true, (cells & x_low << (kBlockSide - 1)) != 0};
    y = {(cells & y_low) != 0, true, (cells & y_low << (kBlockSide - 1) * kBlockSide) != 0};
    z = {(cells & z_low) != 0, true, (cells & z_low << (kBlockSide - 1) * kBlockSide * kBlockSide) != 0};
  }
  std::array<bool, 3> x, y, z;  ///< whether cells touch the neighbours at -1, 0, 1
};

/// Counts of the cells that may bound their neighbours' radii, and zero for all others. A cell does when it holds
/// enough samples itself and none of its children does: see find_block_radii(). Left out is what none of `cells`
/// touches.
HaloCounts bounding_counts(const CellBlocks& level, CellBlock& block, std::uint64_t cells, std::uint32_t enough) {
  HaloCounts halo{};
  const Sides sides(cells);
  const auto first = [](int d) { return d > 0 ? kBlockSide : d < 0 ? -1 : 0; };
  const auto last = [](int d) { return d > 0 ? kBlockSide : d < 0 ? -1 : kBlockSide - 1; };
  for (int n = 0; n < 27; ++n) {
    const int dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
    if (!sides.x[n % 3] || !sides.y[n / 3 % 3] || !sides.z[n / 9]) continue;
    const std::uint32_t index = level.find({block.key.x + dx, block.key.y + dy, block.key.z + dz});
    if (index == CellBlocks::kNone || level[index].most < enough) continue;
    const CellBlock& from = level[index];
    block.most_around = std::max(block.most_around, from.most);
    for (int z = first(dz); z <= last(dz); ++z) {
      for (int y = first(dy); y <= last(dy); ++y) {
        for (int x = first(dx); x <= last(dx); ++x) {
          const std::uint32_t cell = cell_in_block(x, y, z);
          const bool bounds = from.counts[cell] >= enough && (from.refined >> cell & 1U) == 0;
          if (bounds) halo[halo_index(x, y, z)] = from.counts[cell];
        }
      }
    }
  }
  return halo;
}

/// Replaces the value of every inner cell by the largest of the 27 around it, one axis after the other.
void spread_maximum(HaloCounts& halo) {
  const std::size_t n = halo.size();
  for (const std::size_t stride : {std::size_t{1}, std::size_t{kHalo}, std::size_t{kHalo * kHalo}}) {
    const HaloCounts from = halo;
    for (std::size_t i = stride; i + stride < n; ++i) {
      halo[i] = std::max(from[i], std::max(from[i - stride], from[i + stride]));
    }
  }
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

  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
    const std::size_t end = std::min(n, (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      refs[i] = finest.find(key(i));
      if (refs[i] == CellBlocks::kNone && (missing[chunk].empty() || !(missing[chunk].back() == key(i)))) {
        missing[chunk].push_back(key(i));
      }
    }
  });
  for (const auto& keys : missing) {
    for (const auto& k : keys) {
      if (finest.insert(k) >= std::numeric_limits<CellRef>::max() / kBlockCells) {
        throw Error(ExitCode::budget, "radii: too many counting cells in the window; raise the finest cell size");
      }
    }
  }
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
    const std::size_t end = std::min(n, (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      if (refs[i] == CellBlocks::kNone) refs[i] = finest.find(key(i));
      refs[i] = refs[i] * kBlockCells + cell_in_block(x[i], y[i], z[i]);
    }
    // Successive samples of one cell are added together: coincident ones would have all threads at one counter.
    for (std::size_t i = chunk * kChunk; i < end;) {
      std::size_t same = i + 1;
      while (same < end && refs[same] == refs[i]) ++same;
      std::atomic_ref<std::uint32_t> counter(finest[refs[i] / kBlockCells].counts[refs[i] % kBlockCells]);
      counter.fetch_add(static_cast<std::uint32_t>(same - i), std::memory_order_relaxed);
      i = same;
    }
  });
}

void CellOctree::aggregate(std::int64_t begin, std::int64_t end) {
  for (int level = 0; level < settings_.levels; ++level) {
    const ZRange range = cells_of(begin, end, level);
    CellBlocks& fine = levels_[static_cast<std::size_t>(level)];
    for (const std::uint32_t index : fine.between(range.begin, range.end)) {
      CellBlock& from = fine[index];
      const std::uint64_t cells = occupied_cells(from, range.begin, range.end);
      for_each_bit(cells, [&](std::uint32_t cell) { from.most = std::max(from.most, from.counts[cell]); });
      if (is_coarsest(level)) continue;
      CellBlocks& coarse = levels_[static_cast<std::size_t>(level) + 1];
      CellBlock& to = coarse[coarse.insert(parent_key(from.key))];
      for_each_bit(cells, [&](std::uint32_t cell) {
        const std::uint32_t parent = parent_cell(from.key, cell);
        to.counts[parent] += from.counts[cell];
        if (from.counts[cell] >= settings_.min_samples) to.refined |= std::uint64_t{1} << parent;
      });
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
  const CellBlock* parents = nullptr;
  if (!is_coarsest(level)) {
    const CellBlocks& coarse = levels_[static_cast<std::size_t>(level) + 1];
    parents = &coarse[coarse.find(parent_key(block.key))];
  }
  const std::uint32_t enough = parents == nullptr ? 1 : settings_.min_samples;
  const std::uint64_t cells = occupied_cells(block, range.begin, range.end);
  const bool may_be_bounded = parents == nullptr || parents->most_around >= enough;
  HaloCounts bounding{};
  if (may_be_bounded) {
    bounding = bounding_counts(blocks, block, cells, enough);
    spread_maximum(bounding);
  }
  const double diameter = 2.0 * settings_.finest_cell * static_cast<double>(std::int64_t{1} << level);
  const auto radius_of = [&](std::uint32_t count) {
    return static_cast<float>(diameter / std::sqrt(static_cast<double>(count)));
  };
  for_each_bit(cells, [&](std::uint32_t cell) {
    const std::uint32_t count = block.counts[cell];
    float radius = count >= enough ? radius_of(count) : parents->radii[parent_cell(block.key, cell)];
    const std::uint32_t most = bounding[halo_index(cell_x(cell), cell_y(cell), cell_z(cell))];
    if (most > 0) radius = std::min(radius, settings_.neighbour_bound * radius_of(most));
    block.radii[cell] = radius;
  });
}

void CellOctree::drop_below(std::int64_t group) {
  for (int level = 0; level < settings_.levels; ++level) {
    levels_[static_cast<std::size_t>(level)].drop_below(cells_of(group, group, level).begin);
  }
}

}  // namespace lamina
