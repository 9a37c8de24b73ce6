#include "mls/overhang.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "base/four.h"
#include "mls/extension.h"
#include "mls/kernel.h"

namespace lamina {
namespace {

constexpr int kLeanBits = 10;
constexpr float kLeanSteps = 511;
constexpr std::uint32_t kLeanMask = (1U << kLeanBits) - 1;

/// What the bits of a component stand for.
constexpr auto kLeanOfBits = [] {
  std::array<float, kLeanMask + 1> out{};
  for (std::uint32_t bits = 0; bits <= kLeanMask; ++bits) {
    const auto steps = static_cast<std::int32_t>(bits << (32 - kLeanBits)) >> (32 - kLeanBits);
    out[bits] = static_cast<float>(steps) / kLeanSteps;
  }
  return out;
}();

float dot(const std::array<float, 3>& a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// The length of a vector's part across a normal.
float across(const std::array<float, 3>& v, const std::array<float, 3>& normal) {
  const float along = dot(normal, v.data());
  const float squared = dot(v, v.data()) - along * along;
  return std::sqrt(std::max(0.0F, squared));
}

}  // namespace

float packed_lean(const std::array<float, 3>& lean) {
  const FourFloats one{1, 1, 1, 1};
  FourFloats v{lean[0], lean[1], lean[2], 0};
  v = v < -one ? -one : v;
  v = one < v ? one : v;
  const FourInts steps = rounded(v * kLeanSteps) & static_cast<std::int32_t>(kLeanMask);
  return std::bit_cast<float>(steps[0] | steps[1] << kLeanBits | steps[2] << (2 * kLeanBits));
}

std::array<float, 3> unpacked_lean(float packed) {
  const auto bits = std::bit_cast<std::uint32_t>(packed);
  return {kLeanOfBits[bits & kLeanMask], kLeanOfBits[bits >> kLeanBits & kLeanMask],
          kLeanOfBits[bits >> (2 * kLeanBits) & kLeanMask]};
}

float own_overhang(const float* record, const std::array<float, 3>& normal) {
  return across(unpacked_lean(record[kLean]), normal);
}

float overhang(const CornerBlock& block, int offset, int slab_layers, const std::array<float, 3>& normal) {
  const CornerValues& values = block.values[static_cast<std::size_t>((offset >> 6) / slab_layers)];
  const float* own = nullptr;
  if (block.seen.test(offset) && values.count > 0) own = values.of(block.value_index(offset, slab_layers));
  std::array<float, 3> sum{};
  float total = 0;
  if (own != nullptr) {
    sum = unpacked_lean(own[kLean]);
    total = 1;
  }
  for_records_around(block, offset, &Projected::seen, slab_layers, [&](int dx, int dy, int dz, const float* v) {
    if (dot(normal, v + kNormalX) < kSheetCosine) return;
    std::array<float, 3> lean = unpacked_lean(v[kLean]);
    if (own == nullptr) {
      lean[0] += kLeanPerCell * static_cast<float>(dx);
      lean[1] += kLeanPerCell * static_cast<float>(dy);
      lean[2] += kLeanPerCell * static_cast<float>(dz);
    }
    const float weight = neighbour_weight(dx, dy, dz);
    for (std::size_t k = 0; k < 3; ++k) sum[k] += weight * lean[k];
    total += weight;
  });
  if (total <= 0) return 1;
  for (float& s : sum) s /= total;
  return across(sum, normal);
}

}  // namespace lamina
