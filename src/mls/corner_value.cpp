#include "mls/corner_value.h"

#include <cmath>
#include <utility>

#include "octree/finer_corner.h"

namespace lamina {
namespace {

struct Place {
  const CornerBlock* block;
  int offset;
};

Place place_of(const Window& window, int level, const Cell& corner) {
  return {window.probe(level, block_of(corner)), offset_in_block(corner)};
}

/// The place beside another, at most one step away on each axis.
Place beside(const Place& p, int dx, int dy, int dz) {
  const int x = (p.offset & 7) + dx;
  const int y = ((p.offset >> 3) & 7) + dy;
  const int z = (p.offset >> 6) + dz;
  return {p.block->around[CornerBlock::towards(x >> 3, y >> 3, z >> 3)], BlockMask::offset(x & 7, y & 7, z & 7)};
}

/// Own value; the corner must be active and its slab projected.
void own_value(const Window& window, int level, const Place& p, CornerValue& out, float* attributes, float weight) {
  const CornerValues& values = p.block->values[window.slab_in_leaf(level, p.offset >> 6)];
  const std::uint32_t i = p.block->value_index(p.offset, window.slab_layers(level));
  const float* const v = values.of(i);
  out = {v[kDistance], {v[kNormalX], v[kNormalY], v[kNormalZ]}, v[kCurvature], v[kOffsetFromMean]};
  if (attributes == nullptr) return;
  for (int c = 0; c < window.attributes(); ++c) attributes[c] += weight * v[kFirstAttribute + c];
}

bool has_values(const Window& window, int level, const Place& p) {
  return p.block->values[window.slab_in_leaf(level, p.offset >> 6)].count != 0;
}

}  // namespace

bool corner_value(const Window& window, int level, const Cell& corner, CornerValue& out, float* attributes) {
  const Place here = place_of(window, level, corner);
  if (here.block->shared.test(here.offset)) {
    const FinerCorner finer = finer_corner(window, level, corner);
    return corner_value(window, finer.level, finer.corner, out, attributes);
  }
  for (int c = 0; attributes != nullptr && c < window.attributes(); ++c) attributes[c] = 0;
  if (here.block->trusted.test(here.offset) && has_values(window, level, here)) {
    own_value(window, level, here, out, attributes, 1);
    return true;
  }
  const auto cell = static_cast<float>(window.lattice().cell_size(level));
  CornerValue sum;
  float total = 0;
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int m = (dx != 0) + (dy != 0) + (dz != 0);
        if (m == 0) continue;
        const Place p = beside(here, dx, dy, dz);
        if (p.block == nullptr || !p.block->trusted.test(p.offset) || !has_values(window, level, p)) continue;
        const float w = 1.0F / static_cast<float>(m * m);
        CornerValue v;
        own_value(window, level, p, v, attributes, w);
        sum.distance +=
            w * (v.distance - cell * (v.normal[0] * static_cast<float>(dx) + v.normal[1] * static_cast<float>(dy) +
                                      v.normal[2] * static_cast<float>(dz)));
        for (int k = 0; k < 3; ++k) sum.normal[k] += w * v.normal[k];
        sum.curvature += w * v.curvature;
        total += w;
      }
    }
  }
  if (total <= 0) {
    if (!here.block->defined.test(here.offset) || !here.block->seen.test(here.offset)) return false;
    own_value(window, level, here, out, attributes, 1);
    return true;
  }
  const float inv = 1.0F / total;
  const float length =
      std::sqrt(sum.normal[0] * sum.normal[0] + sum.normal[1] * sum.normal[1] + sum.normal[2] * sum.normal[2]);
  if (!(length > 1e-6F)) return false;
  out.distance = sum.distance * inv;
  for (int k = 0; k < 3; ++k) out.normal[k] = sum.normal[k] / length;
  out.curvature = sum.curvature * inv;
  out.offset_from_mean = 0;
  for (int c = 0; attributes != nullptr && c < window.attributes(); ++c) attributes[c] *= inv;
  return true;
}

}  // namespace lamina
