// The kernel of the search for nearest samples, for x86-64-v2 processors (flags set in src/CMakeLists.txt).
#include <immintrin.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "samples/near_kernel.h"

namespace lamina::near_v2 {
namespace {

typedef std::int32_t Ints __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs
typedef float Floats __attribute__((vector_size(16)));       // NOLINT(modernize-use-using): attributes on typedefs
constexpr std::size_t kVectorsAtOnce = 2;

inline unsigned bits_of(const Ints& mask) {
  return static_cast<unsigned>(_mm_movemask_ps(std::bit_cast<__m128>(mask)));
}

#include "samples/near_kernel_masks.h"

/// By the bits of a mask: the bytes of those of four values that it has, one after another.
using BytesOfFour = std::array<std::array<std::uint8_t, 16>, 16>;
constexpr BytesOfFour bytes_by_mask() {
  BytesOfFour all{};
  for (std::size_t mask = 0; mask < 16; ++mask) {
    std::size_t at = 0;
    for (std::size_t lane = 0; lane < 4; ++lane) {
      if ((mask >> lane & 1) == 0) continue;
      for (std::size_t byte = 0; byte < 4; ++byte) all[mask][at++] = static_cast<std::uint8_t>(4 * lane + byte);
    }
  }
  return all;
}
constexpr BytesOfFour kBytes = bytes_by_mask();

using Order = __m128i;
inline Order order_of(unsigned mask) {
  Order order;
  __builtin_memcpy(&order, kBytes[mask].data(), sizeof(order));
  return order;
}
inline Ints in_order(const Ints& v, const Order& order) {
  return std::bit_cast<Ints>(_mm_shuffle_epi8(std::bit_cast<__m128i>(v), order));
}

#include "samples/near_kernel_source.h"

}  // namespace

const NearKernel kKernel{&gather, &find, &sort};

}  // namespace lamina::near_v2
