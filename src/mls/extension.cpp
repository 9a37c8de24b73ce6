#include "mls/extension.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>

#include "lattice/bits.h"
#include "mls/shared_corners.h"

namespace lamina {
namespace {

void gather_block(const Window& window, int level, const CornerBlock& from, int dx, int dy, int z, int to_z,
                  CornerField& f) {
  const int layers = window.slab_layers(level);
  std::uint64_t w = from.trusted.words[z];
  if (w == 0) return;
  if (dx < 0) w &= 0x8080808080808080ULL;
  if (dx > 0) w &= 0x0101010101010101ULL;
  if (dy < 0) w &= 0xFF00000000000000ULL;
  if (dy > 0) w &= 0x00000000000000FFULL;
  if (w == 0) return;
  const CornerValues& values = from.values[window.slab_in_leaf(level, z)];
  if (values.count == 0) return;
  const std::uint32_t base = from.value_index(z * 64, layers);
  const std::uint64_t active = from.active.words[z];
  for (; w != 0; w &= w - 1) {
    const int bit = std::countr_zero(w);
    const std::uint32_t i = base + static_cast<std::uint32_t>(std::popcount(active & ((std::uint64_t{1} << bit) - 1)));
    const float* const v = values.of(i);
    const int row = (bit >> 3) + dy * 8 + 1;
    const int at = (to_z + 1) * CornerField::kPlane + row * CornerField::kRow + (bit & 7) + dx * 8 + 1;
    f.distance[at] = v[kDistance];
    f.nx[at] = v[kNormalX];
    f.ny[at] = v[kNormalY];
    f.nz[at] = v[kNormalZ];
    f.trusted[at] = 1.0F;
    f.any[(to_z + 1) * CornerField::kRows + row] = 1;
  }
}

/// The trusted corners of a block and of its 26 neighbours.
bits::Neighbourhood trusted_around(const std::array<CornerBlock*, 27>& around) {
  bits::Neighbourhood n{};
  for (int i = 0; i < 27; ++i) n[i / 9][i / 3 % 3][i % 3] = around[i] == nullptr ? nullptr : &around[i]->trusted;
  return n;
}

void gather_field(const Window& window, int level, const std::array<CornerBlock*, 27>& around, int begin, int end,
                  CornerField& f) {
  for (auto* a : {&f.distance, &f.nx, &f.ny, &f.nz, &f.trusted}) {
    std::fill(a->begin() + begin * CornerField::kPlane, a->begin() + (end + 2) * CornerField::kPlane, 0.0F);
  }
  std::fill(f.any.begin() + begin * CornerField::kRows, f.any.begin() + (end + 2) * CornerField::kRows, 0);
  for (int dz = -1; dz <= 1; ++dz) {
    const int from = std::max(begin - 1, dz * 8);
    const int to = std::min(end + 1, dz * 8 + 8);
    if (from >= to) continue;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const CornerBlock* block = around[13 + dx + 3 * dy + 9 * dz];
        if (block == nullptr) continue;
        for (int z = from; z < to; ++z) gather_block(window, level, *block, dx, dy, z - dz * 8, z, f);
      }
    }
  }
}

/// Bits of a layer's corners: their signs, and whether anything speaks for them.
struct Signs {
  std::uint64_t outside = 0, defined = 0, supported = 0;
};

/// A corner's own projected point is better than none when it lies no farther from the average of its samples than
/// this (support radii).
constexpr float kOwnReach = 0.7F;

/// A corner with trusted neighbours on all sides lies over a small gap between samples, not beyond a boundary: their
/// mean is this near to it (squared, in cells; that of half of the neighbours in a plane is 0.4 away, of one side's 1).
constexpr float kSurrounded = 0.3F * 0.3F;

/// Corners of the layer whose own projected point lies beyond the limit.
std::uint64_t beyond(const Window& window, int level, const CornerBlock& leaf, int z, float boundary) {
  std::uint64_t out = 0;
  if (leaf.seen.words[z] == 0) return 0;
  const CornerValues& values = leaf.values[window.slab_in_leaf(level, z)];
  std::uint32_t i = leaf.value_index(z * 64, window.slab_layers(level));
  for (std::uint64_t w = leaf.active.words[z]; w != 0; w &= w - 1, ++i) {
    if (values.channel(kOffsetFromMean)[i] > boundary) out |= w & (~w + 1);
  }
  return out & leaf.seen.words[z];
}

/// Of the layer's corners that a finer level holds.
Signs finer_signs(const Window& window, int level, const Tile& t, int z) {
  Signs out;
  for (std::uint64_t w = t.leaf->shared.words[z]; w != 0; w &= w - 1) {
    const FinerCorner from = finer_corner(window, level, t, z, std::countr_zero(w));
    const std::uint64_t one = w & (~w + 1);
    if (from.block->outside.test(from.offset)) out.outside |= one;
    if (from.block->defined.test(from.offset)) out.defined |= one;
    if (from.block->supported.test(from.offset)) out.supported |= one;
  }
  return out;
}

/// Of the layer's corners in `wanted`, by the planes of their trusted neighbours.
Signs extended_signs(const Kernel& kernel, const CornerField& field, int z, float cell, std::uint64_t wanted) {
  Signs out;
  for (int y = 0; y < 8; ++y) {
    if (((wanted >> (8 * y)) & 0xFFU) == 0) continue;
    const Extension e = kernel.extend(field, y, z, cell, kSurrounded);
    out.outside |= std::uint64_t{e.outside} << (8 * y);
    out.defined |= std::uint64_t{e.defined} << (8 * y);
    out.supported |= std::uint64_t{e.surrounded} << (8 * y);
  }
  return {out.outside & wanted, out.defined & wanted, out.supported & wanted};
}

void extend_tile(const Window& window, int level, const Tile& t, int begin, int end, const Kernel& kernel,
                 float boundary, CornerField& field) {
  const auto cell = static_cast<float>(window.lattice().cell_size(level));
  const std::array<CornerBlock*, 27>& around = t.leaf->around;
  std::array<std::uint64_t, 8> spread{};  // corners beside trusted ones
  bits::dilate_layers<-1, 1>(trusted_around(around), begin, end, &spread[begin]);
  bool gathered = false;
  for (int z = begin; z < end; ++z) {
    const std::uint64_t corners = t.leaf->corners.words[z];
    if (corners == 0) continue;
    const std::uint64_t shared = t.leaf->shared.words[z];
    const std::uint64_t trusted = t.leaf->trusted.words[z];
    const std::uint64_t own = t.leaf->outside.words[z];  // as projection left them
    Signs signs;
    if (shared != 0) signs = finer_signs(window, level, t, z);
    signs.outside |= own & trusted & ~shared;
    signs.defined |= trusted & ~shared;
    signs.supported |= t.leaf->seen.words[z] & ~shared;
    if (const std::uint64_t wanted = corners & ~shared & ~trusted; wanted != 0) {
      Signs extended;
      if (const std::uint64_t beside = wanted & spread[z]; beside != 0) {
        if (!gathered) gather_field(window, level, around, begin, end, field);
        gathered = true;
        extended = extended_signs(kernel, field, z, cell, beside);
      }
      // Nobody to extend from.
      const std::uint64_t lone = wanted & ~extended.defined;
      std::uint64_t alone = lone & t.leaf->seen.words[z];
      if (alone != 0) alone &= ~beyond(window, level, *t.leaf, z, kOwnReach);
      signs.outside |= (extended.outside & extended.defined) | (lone & ~alone);
      signs.outside |= own & alone;
      signs.defined |= extended.defined | alone;
      signs.supported |= extended.supported;
    }
    if (boundary > 0) signs.defined &= ~(beyond(window, level, *t.leaf, z, boundary) & ~shared);
    t.leaf->outside.words[z] = signs.outside & corners;
    t.leaf->defined.words[z] = signs.defined & corners;
    t.leaf->supported.words[z] = signs.supported & corners;
  }
}

}  // namespace

void extend_slab(Window& window, std::int32_t slab, const Kernel& kernel, float boundary) {
  tbb::enumerable_thread_specific<CornerField> fields;
  for (int level = 0; level < window.levels(); ++level) {
    const Tiles tiles = window.tiles(level, slab);
    tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
      const std::int32_t first = window.lattice().first_layer(level, slab) - tiles[i].block.z * 8;
      const int end = std::min(8, first + window.lattice().layers(level));
      extend_tile(window, level, tiles[i], std::max(first, 0), end, kernel, boundary, fields.local());
    });
  }
}

}  // namespace lamina
