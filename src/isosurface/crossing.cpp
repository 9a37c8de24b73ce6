#include "isosurface/tile_view.h"

#include <algorithm>
#include <atomic>

#include "octree/window.h"

namespace lamina {
namespace {

/// Corners at layer z with a subdivided cell among the eight around them: a finer level may hold them too.
std::uint64_t beside_split(const Slice& below, const Slice& here) {
  const auto four = [](const Slice& s) {
    return s.any() ? s.here() | s.at<-1, 0>() | s.at<0, -1>() | s.at<-1, -1>() : 0;
  };
  return four(below) | four(here);
}

void set_layer(std::uint8_t& layers, int z, bool on) {
  layers = static_cast<std::uint8_t>((layers & ~(1U << z)) | static_cast<unsigned>(on) << z);
}

/// Of a block that other tiles may be reaching too.
void reach_layer(CornerBlock* block, int z) {
  if (block == nullptr) return;
  const std::atomic_ref<std::uint8_t> layers(block->surface_layers);
  const auto bit = static_cast<std::uint8_t>(1U << z);
  if ((layers.load(std::memory_order_relaxed) & bit) == 0) layers.fetch_or(bit, std::memory_order_relaxed);
}

/// Notes the layers in which edges of layer z begin and end.
void reach_ends(const TileView& tile, int z, const std::array<std::uint64_t, 3>& accepted) {
  if ((accepted[0] | accepted[1] | accepted[2]) == 0) return;
  reach_layer(&tile.leaf(), z);
  if ((accepted[0] & ~bits::columns_below(7)) != 0) reach_layer(tile.neighbour(1, 0, 0), z);
  if ((accepted[1] >> 56) != 0) reach_layer(tile.neighbour(0, 1, 0), z);
  if (accepted[2] != 0) reach_layer(tile.neighbour(0, 0, (z + 1) >> 3), (z + 1) & 7);
}

/// Several tiles, of several levels, may mark in one block.
void add_surface(CornerBlock& block, int z, std::uint64_t corners) {
  std::atomic_ref(block.surface.words[z]).fetch_or(corners, std::memory_order_relaxed);
}

/// In the finest level that holds the corner of `level`.
void mark_finest(Window& window, int level, Cell corner) {
  for (FinerCorner finer = finer_corner(window, level, corner); finer.block != nullptr;
       finer = finer_corner(window, level, corner)) {
    level = finer.level;
    corner = finer.corner;
  }
  CornerBlock* holder = window.probe(level, block_of(corner));
  const int offset = offset_in_block(corner);
  reach_layer(holder, offset >> 6);
  add_surface(*holder, offset >> 6, std::uint64_t{1} << (offset & 63));
}

}  // namespace

Quadrants around_edges(int axis, const Slice& below, const Slice& here) {
  switch (axis) {
    case 0:
      return {{below.at<0, -1>(), below.here(), here.here(), here.at<0, -1>()}};
    case 1:
      return {{below.at<-1, 0>(), here.at<-1, 0>(), here.here(), below.here()}};
    default:
      return {{here.at<-1, -1>(), here.at<0, -1>(), here.here(), here.at<-1, 0>()}};
  }
}

void find_crossing(const TileView& tile) {
  CornerBlock& leaf = tile.leaf();
  const CornerBlock* const right = tile.neighbour(1, 0, 0);
  const CornerBlock* const up = tile.neighbour(0, 1, 0);
  for (int z = tile.begin; z < tile.end; ++z) {
    const CornerBlock* const above = tile.neighbour(0, 0, (z + 1) >> 3);
    // The words of a mask at the other ends of the layer's edges.
    const auto ends = [&](BlockMask CornerBlock::*mask) {
      const std::uint64_t here = (leaf.*mask).words[z];
      return std::array<std::uint64_t, 3>{bits::shift_x(0, here, right == nullptr ? 0 : (right->*mask).words[z], -1),
                                          bits::shift_y(0, here, up == nullptr ? 0 : (up->*mask).words[z], -1),
                                          above == nullptr ? 0 : (above->*mask).words[(z + 1) & 7]};
    };
    std::array<std::uint64_t, 3> change{};
    std::array<std::uint64_t, 3> accepted{};
    const std::uint64_t corners = leaf.corners.words[z];
    if (corners != 0) {
      const std::array<std::uint64_t, 3> outside = ends(&CornerBlock::outside);
      const std::array<std::uint64_t, 3> held = ends(&CornerBlock::corners);
      for (int axis = 0; axis < 3; ++axis) {
        change[axis] = (leaf.outside.words[z] ^ outside[axis]) & corners & held[axis];
      }
    }
    if ((change[0] | change[1] | change[2]) != 0) {
      const Slice cells_below(tile, &CornerBlock::cells, z - 1);
      const Slice cells(tile, &CornerBlock::cells, z);
      for (int axis = 0; axis < 3; ++axis) change[axis] &= around_edges(axis, cells_below, cells).any();
      if (tile.level > 0) {
        const Slice split_below(tile, &CornerBlock::split, z - 1);
        const Slice split(tile, &CornerBlock::split, z);
        if (split_below.any() || split.any()) {
          for (int axis = 0; axis < 3; ++axis) change[axis] &= ~around_edges(axis, split_below, split).any();
        }
      }
      const std::array<std::uint64_t, 3> defined = ends(&CornerBlock::defined);
      const std::array<std::uint64_t, 3> supported = ends(&CornerBlock::supported);
      for (int axis = 0; axis < 3; ++axis) {
        accepted[axis] =
            change[axis] & leaf.defined.words[z] & defined[axis] & (leaf.supported.words[z] | supported[axis]);
      }
    }
    const bool has_edges = (change[0] | change[1] | change[2]) != 0;
    // Nearly all layers are without edges and were before: their masks stay out of the cache.
    if (!has_edges && ((leaf.busy_layers | leaf.doubtful_layers) >> z & 1U) == 0) continue;
    for (int axis = 0; axis < 3; ++axis) {
      leaf.crossing[axis].words[z] = change[axis];
      leaf.accepted[axis].words[z] = accepted[axis];
    }
    leaf.busy.words[z] = accepted[0] | accepted[1] | accepted[2];
    set_layer(leaf.busy_layers, z, leaf.busy.words[z] != 0);
    set_layer(leaf.doubtful_layers, z, accepted != change);
    reach_ends(tile, z, accepted);
  }
}

void add_finer_busy(const TileView& tile, const Window& window) {
  CornerBlock& leaf = tile.leaf();
  for (int half = 0; half < 2; ++half) {
    if (tile.begin >= 4 * half + 4 || tile.end <= 4 * half) continue;
    for (int quarter = 0; quarter < 4; ++quarter) {
      const int qx = quarter & 1;
      const int qy = quarter >> 1;
      const CornerBlock* finer =
          window.probe(tile.level - 1, {2 * tile.block.x + qx, 2 * tile.block.y + qy, 2 * tile.block.z + half});
      if (finer == nullptr || finer->busy_layers == 0) continue;
      for (int z = std::max(tile.begin, 4 * half); z < std::min(tile.end, 4 * half + 4); ++z) {
        const int from = 2 * (z - 4 * half);
        const std::uint64_t pair = finer->busy.words[from] | finer->busy.words[from + 1];
        leaf.busy.words[z] |= bits::even_quarter(bits::fold_pairs(pair), qx, qy);
        set_layer(leaf.busy_layers, z, leaf.busy.words[z] != 0);
      }
    }
  }
}

void mark_surface(const TileView& tile, Window& window) {
  const auto accepted = [&](int axis, int dx, int dy, int z) {
    const CornerBlock* b = tile.neighbour(dx, dy, z < 0 ? -1 : 0);
    return b == nullptr ? std::uint64_t{0} : b->accepted[axis].words[z & 7];
  };
  CornerBlock& leaf = tile.leaf();
  for (int z = tile.begin; z < tile.end; ++z) {
    const std::uint64_t along_x = accepted(0, 0, 0, z);
    const std::uint64_t along_y = accepted(1, 0, 0, z);
    const std::uint64_t ends = along_x | bits::shift_x(accepted(0, -1, 0, z), along_x, 0, 1) | along_y |
                               bits::shift_y(accepted(1, 0, -1, z), along_y, 0, 1) | accepted(2, 0, 0, z) |
                               accepted(2, 0, 0, z - 1);
    if (ends == 0) continue;
    std::uint64_t shared = 0;
    if (tile.level > 0) {
      shared = ends & beside_split(Slice(tile, &CornerBlock::split, z - 1), Slice(tile, &CornerBlock::split, z));
    }
    add_surface(leaf, z, ends & ~shared);
    for_bits(shared, [&](int bit) { mark_finest(window, tile.level, tile.cell(z * 64 + bit)); });
  }
}

std::uint32_t CornerPlace::number() const {
  const std::uint64_t before = (std::uint64_t{1} << (offset & 63)) - 1;
  return block->numbers[offset >> 6].corner_base +
         static_cast<std::uint32_t>(std::popcount(block->surface.words[offset >> 6] & before));
}

CornerPlace surface_place(BlockCache& cache, int level, const Cell& corner) {
  Cell c = corner;
  for (int l = level; l >= 0; --l) {
    const CornerBlock* block = cache.block(l, c);
    if (block != nullptr && block->surface.test(offset_in_block(c))) return {block, offset_in_block(c), l};
    c = {c.x * 2, c.y * 2, c.z * 2};
  }
  return {};
}

}  // namespace lamina
