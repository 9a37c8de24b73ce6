#include "mls/overhang.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "mls/kernel.h"

namespace lamina {
namespace {

constexpr int kLeanBits = 10;
constexpr float kLeanSteps = 511;
constexpr std::uint32_t kLeanMask = (1U << kLeanBits) - 1;

float dot(const std::array<float, 3>& a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// A neighbouring corner and its weight, in the order of for_neighbours().
struct Beside {
  int x, y, z;
  float weight;
};
constexpr std::array<Beside, 26> kAround = [] {
  std::array<Beside, 26> out{};
  std::size_t n = 0;
  for_neighbours([&](int dx, int dy, int dz) { out[n++] = {dx, dy, dz, neighbour_weight(dx, dy, dz)}; });
  return out;
}();

/// The length of a vector's part across a normal.
float across(const std::array<float, 3>& v, const std::array<float, 3>& normal) {
  const float along = dot(normal, v.data());
  const float squared = dot(v, v.data()) - along * along;
  return std::sqrt(std::max(0.0F, squared));
}

}  // namespace

float packed_lean(const std::array<float, 3>& lean) {
  std::uint32_t bits = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto steps = static_cast<std::int32_t>(std::lrint(std::clamp(lean[k], -1.0F, 1.0F) * kLeanSteps));
    bits |= (static_cast<std::uint32_t>(steps) & kLeanMask) << (kLeanBits * k);
  }
  return std::bit_cast<float>(bits);
}

std::array<float, 3> unpacked_lean(float packed) {
  const auto bits = std::bit_cast<std::uint32_t>(packed);
  std::array<float, 3> lean{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto up = static_cast<std::int32_t>(bits << (32 - kLeanBits * (k + 1)));
    lean[k] = static_cast<float>(up >> (32 - kLeanBits)) / kLeanSteps;
  }
  return lean;
}

float overhang(const Window& window, int level, const Cell& corner, const std::array<float, 3>& normal, float trim) {
  const CornerBlock* const block = window.probe(level, block_of(corner));
  const int here = offset_in_block(corner);
  const int slab_layers = window.slab_layers(level);
  const int layer_shift = std::countr_zero(static_cast<unsigned>(slab_layers));
  const auto record_at = [&](const CornerBlock* b, int offset) -> const float* {
    if (b == nullptr || !b->seen.test(offset)) return nullptr;
    const CornerValues& values = b->values[static_cast<std::size_t>((offset >> 6) >> layer_shift)];
    return values.count == 0 ? nullptr : values.of(b->value_index(offset, slab_layers));
  };
  const float* const own = record_at(block, here);
  std::array<float, 3> sum{};
  float total = 0;
  if (own != nullptr) {
    sum = unpacked_lean(own[kLean]);
    total = 1;
    const float alone = across(sum, normal);
    if (alone < kUpright * trim && block->trusted.test(here)) return alone;
  }
  for (const Beside& to : kAround) {
    const int x = (here & 7) + to.x;
    const int y = ((here >> 3) & 7) + to.y;
    const int z = (here >> 6) + to.z;
    const float* const v =
        record_at(block->around[CornerBlock::towards(x >> 3, y >> 3, z >> 3)], BlockMask::offset(x & 7, y & 7, z & 7));
    if (v == nullptr || dot(normal, v + kNormalX) < kSameSheet) continue;
    std::array<float, 3> lean = unpacked_lean(v[kLean]);
    if (own == nullptr) {
      lean[0] += kLeanPerCell * static_cast<float>(to.x);
      lean[1] += kLeanPerCell * static_cast<float>(to.y);
      lean[2] += kLeanPerCell * static_cast<float>(to.z);
    }
    for (std::size_t k = 0; k < 3; ++k) sum[k] += to.weight * lean[k];
    total += to.weight;
  }
  if (total <= 0) return 1;
  for (float& s : sum) s /= total;
  return across(sum, normal);
}

}  // namespace lamina
