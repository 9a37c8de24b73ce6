// The kernel of the search for nearest samples, for x86-64-v3 processors (flags set in src/CMakeLists.txt).
#include <immintrin.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "samples/near_kernel.h"

namespace lamina::near_v3 {
namespace {

typedef std::int32_t Ints __attribute__((vector_size(32)));  // NOLINT(modernize-use-using): attributes on typedefs
typedef float Floats __attribute__((vector_size(32)));       // NOLINT(modernize-use-using): attributes on typedefs
constexpr std::size_t kVectorsAtOnce = 4;

inline unsigned bits_of(const Ints& mask) {
  return static_cast<unsigned>(_mm256_movemask_ps(std::bit_cast<__m256>(mask)));
}

#include "samples/near_kernel_masks.h"

/// By the bits of a mask: the numbers of the lanes that it has, one after another, a byte each.
constexpr std::array<std::uint64_t, 256> lanes_by_mask() {
  std::array<std::uint64_t, 256> all{};
  for (std::size_t mask = 0; mask < 256; ++mask) {
    int n = 0;
    for (std::uint64_t lane = 0; lane < 8; ++lane) {
      if ((mask >> lane & 1) != 0) all[mask] |= lane << (8 * n++);
    }
  }
  return all;
}
constexpr std::array<std::uint64_t, 256> kListed = lanes_by_mask();

using Order = __m256i;
inline Order order_of(unsigned mask) {
  return _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kListed[mask])));
}
inline Ints in_order(const Ints& v, const Order& order) {
  return std::bit_cast<Ints>(_mm256_permutevar8x32_epi32(std::bit_cast<__m256i>(v), order));
}

#include "samples/near_kernel_source.h"

}  // namespace

const NearKernel kKernel{&gather, &find, &sort};

}  // namespace lamina::near_v3
