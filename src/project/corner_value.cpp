#include "project/corner_value.h"

#include <cmath>
#include <cstdlib>

namespace lamina {
namespace {

bool read_good(const Window& window, int level, const Cell& c, CornerValue& out, float* attributes) {
  const CornerBlock* block = window.probe(level, block_of(c));
  const int offset = offset_in_block(c);
  if (block == nullptr || !block->near.test(offset) || !block->good.test(offset)) return false;
  const CornerValues& values = block->values[window.brick_of(level, offset >> 6)];
  const std::uint32_t i = block->value_index(offset, window.brick_layers(level));
  out.distance = values.channel(kDistance)[i];
  out.normal = {values.channel(kNormalX)[i], values.channel(kNormalY)[i], values.channel(kNormalZ)[i]};
  out.curvature = values.channel(kCurvature)[i];
  out.reach = values.channel(kReach)[i];
  if (attributes != nullptr) {
    for (int a = 0; a < window.attributes(); ++a) attributes[a] = values.channel(kFirstAttribute + a)[i];
  }
  return true;
}

}  // namespace

bool corner_value(const Window& window, int level, const Cell& corner, CornerValue& out, float* attributes) {
  int finest = level;
  Cell c = corner;
  Cell at = corner;
  for (int l = level; l-- > 0;) {
    at = {at.x * 2, at.y * 2, at.z * 2};
    const CornerBlock* block = window.probe(l, block_of(at));
    if (block == nullptr || !block->corners.test(offset_in_block(at))) continue;
    finest = l;
    c = at;
  }
  if (read_good(window, finest, c, out, attributes)) return true;

  const auto cell = static_cast<float>(window.lattice().cell_size(finest));
  std::vector<float> extra(static_cast<std::size_t>(window.attributes()));
  std::vector<float> sums(extra.size());
  CornerValue sum;
  float weight = 0;
  for (int z = -1; z <= 1; ++z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        CornerValue v;
        if ((x | y | z) == 0 || !read_good(window, finest, c + Cell{x, y, z}, v, extra.data())) continue;
        const auto m = static_cast<float>(std::abs(x) + std::abs(y) + std::abs(z));
        const float w = 1 / (m * m);
        const std::array<int, 3> step{-x, -y, -z};
        float d = v.distance;
        for (int i = 0; i < 3; ++i) {
          d += v.normal[i] * static_cast<float>(step[i]) * cell;
          sum.normal[i] += w * v.normal[i];
        }
        sum.distance += w * d;
        sum.curvature += w * v.curvature;
        weight += w;
        for (std::size_t a = 0; a < sums.size(); ++a) sums[a] += w * extra[a];
      }
    }
  }
  const float length = std::hypot(sum.normal[0], sum.normal[1], sum.normal[2]);
  if (weight <= 0 || length <= 0) return false;
  out.distance = sum.distance / weight;
  for (int i = 0; i < 3; ++i) out.normal[i] = sum.normal[i] / length;
  out.curvature = sum.curvature / weight;
  out.reach = 0;
  if (attributes != nullptr) {
    for (std::size_t a = 0; a < sums.size(); ++a) attributes[a] = sums[a] / weight;
  }
  return true;
}

}  // namespace lamina
