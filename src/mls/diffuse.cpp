#include "mls/diffuse.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "mls/shared_corners.h"
#include "octree/block_cache.h"

namespace lamina {
namespace {

struct Leaf {
  int level = -1;  ///< -1: none
  Cell cell;
  bool operator==(const Leaf&) const = default;
};

/// The leaf cell that fills an octant (bit 0: x, 1: y, 2: z; set = above) around a corner of `level`, whatever its
/// level.
Leaf leaf_in_octant(BlockCache& cache, int level, const Cell& corner, int octant) {
  const Cell toward{(octant & 1) - 1, ((octant >> 1) & 1) - 1, (octant >> 2) - 1};
  Cell cell = corner + toward;
  Cell at = corner;
  const CornerBlock* block = cache.block(level, cell);
  if (block != nullptr && block->split.test(offset_in_block(cell))) {
    // Down to the child that touches the corner, until one is not split.
    while (block != nullptr && block->split.test(offset_in_block(cell))) {
      at = {at.x * 2, at.y * 2, at.z * 2};
      cell = at + toward;
      block = cache.block(--level, cell);
    }
    if (block == nullptr || !block->cells.test(offset_in_block(cell))) return {};
    return {level, cell};
  }
  for (; level < cache.window().levels(); ++level) {
    block = cache.block(level, cell);
    if (block != nullptr && block->cells.test(offset_in_block(cell))) return {level, cell};
    if (block != nullptr && block->split.test(offset_in_block(cell))) return {};
    cell = {cell.x >> 1, cell.y >> 1, cell.z >> 1};
  }
  return {};
}

/// One mean of centres' values at a corner.
struct Mean {
  float weight = 0;
  float distance = 0, curvature = 0, offset_from_mean = 0;
  std::array<float, 3> normal{};
};

/// Adds a centre's surface as it is seen from the corner: the second-order distance of the osculating sphere.
void add(const Window& window, const Leaf& leaf, const float* v, int corner_level, const Cell& corner, Mean& mean,
         float* attributes) {
  const auto cell = static_cast<float>(window.lattice().cell_size(leaf.level));
  const auto corner_at = window.lattice().position(corner_level, corner);
  const auto cell_at = window.lattice().position(leaf.level, leaf.cell);
  std::array<float, 3> o{};
  for (int k = 0; k < 3; ++k) o[k] = static_cast<float>(corner_at[k] - cell_at[k]) - 0.5F * cell;
  const std::array<float, 3> n{v[kNormalX], v[kNormalY], v[kNormalZ]};
  const float along = n[0] * o[0] + n[1] * o[1] + n[2] * o[2];
  const float across = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - along * along;
  const float w = 1.0F / cell;
  mean.weight += w;
  mean.distance += w * (v[kDistance] + along + 0.5F * v[kCurvature] * across);
  mean.curvature += w * v[kCurvature];
  mean.offset_from_mean += w * v[kOffsetFromMean];
  for (int k = 0; k < 3; ++k) mean.normal[k] += w * n[k];
  for (int c = 0; c < window.attributes(); ++c) attributes[c] += w * v[kFirstAttribute + c];
}

void diffuse_corner(BlockCache& cache, int level, const Cell& corner, CornerBlock& leaf, int offset, CornerValues& out,
                    std::uint32_t at, std::vector<float>& attributes) {
  const Window& window = cache.window();
  std::array<Leaf, 8> leaves{};
  std::array<const Projected*, 8> centres{};
  int count = 0;
  bool trusted = false;
  for (int octant = 0; octant < 8; ++octant) {
    const Leaf l = leaf_in_octant(cache, level, corner, octant);
    if (l.level < 0 || std::find(leaves.begin(), leaves.begin() + count, l) != leaves.begin() + count) continue;
    const CornerBlock* block = cache.block(l.level, l.cell);
    if (block->centres == nullptr || !block->centres->seen.test(offset_in_block(l.cell))) continue;
    trusted = trusted || block->centres->trusted.test(offset_in_block(l.cell));
    centres[count] = block->centres.get();
    leaves[count++] = l;
  }
  Mean mean;
  attributes.assign(static_cast<std::size_t>(window.attributes()), 0.0F);
  for (int k = 0; k < count; ++k) {
    const Projected& from = *centres[k];
    const int o = offset_in_block(leaves[k].cell);
    if (trusted && !from.trusted.test(o)) continue;
    const CornerValues& values = from.values[window.slab_in_leaf(leaves[k].level, o >> 6)];
    add(window, leaves[k], values.of(from.value_index(o, window.slab_layers(leaves[k].level))), level, corner, mean,
        attributes.data());
  }
  const float length =
      std::sqrt(mean.normal[0] * mean.normal[0] + mean.normal[1] * mean.normal[1] + mean.normal[2] * mean.normal[2]);
  if (mean.weight <= 0 || !(length > 1e-6F * mean.weight)) return;
  const float inv = 1.0F / mean.weight;
  float* const v = out.of(at);
  v[kDistance] = mean.distance * inv;
  v[kNormalX] = mean.normal[0] / length;
  v[kNormalY] = mean.normal[1] / length;
  v[kNormalZ] = mean.normal[2] / length;
  v[kCurvature] = mean.curvature * inv;
  v[kOffsetFromMean] = mean.offset_from_mean * inv;
  for (int c = 0; c < window.attributes(); ++c) v[kFirstAttribute + c] = attributes[static_cast<std::size_t>(c)] * inv;
  leaf.seen.set(offset);
  leaf.outside.assign(offset, mean.distance >= 0);
  if (trusted) leaf.trusted.set(offset);
}

}  // namespace

void diffuse_slab(Window& window, std::int32_t slab) {
  for (int level = 0; level < window.levels(); ++level) {
    const Tiles tiles = window.tiles(level, slab);
    tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
      const Tile& t = tiles[i];
      const std::int32_t first = window.lattice().first_layer(level, slab) - t.block.z * 8;
      const int begin = std::max(first, 0);
      const int end = std::min(8, first + window.lattice().layers(level));
      if (!allocate_values(window, level, *t.leaf, begin, end)) return;
      CornerValues& values = t.leaf->values[window.slab_in_leaf(level, begin)];
      BlockCache cache(window);
      std::vector<float> attributes;
      std::uint32_t at = 0;
      for (int z = begin; z < end; ++z) {
        for (std::uint64_t w = t.leaf->active.words[z]; w != 0; w &= w - 1, ++at) {
          const int bit = std::countr_zero(w);
          if (((t.leaf->shared.words[z] >> bit) & 1U) != 0) continue;
          const Cell corner{t.block.x * 8 + (bit & 7), t.block.y * 8 + (bit >> 3), t.block.z * 8 + z};
          diffuse_corner(cache, level, corner, *t.leaf, z * 64 + bit, values, at, attributes);
        }
      }
      copy_shared(window, level, t, begin, end);
    });
  }
}

}  // namespace lamina
