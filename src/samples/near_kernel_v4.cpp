// The kernel of the search for nearest samples, for x86-64-v4 processors (flags set in src/CMakeLists.txt).
#include <immintrin.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "samples/near_kernel.h"

namespace lamina::near_v4 {
namespace {

typedef std::int32_t Ints __attribute__((vector_size(64)));  // NOLINT(modernize-use-using): attributes on typedefs
typedef float Floats __attribute__((vector_size(64)));       // NOLINT(modernize-use-using): attributes on typedefs
constexpr std::size_t kVectorsAtOnce = 2;

inline unsigned not_above(const Floats& v, float most) {
  return _mm512_cmp_ps_mask(std::bit_cast<__m512>(v), _mm512_set1_ps(most), _CMP_LE_OQ);
}
inline unsigned below(const Ints& v, std::int32_t end) {
  return _mm512_cmplt_epi32_mask(std::bit_cast<__m512i>(v), _mm512_set1_epi32(end));
}
inline unsigned equal(const Ints& v, const Ints& other) {
  return _mm512_cmpeq_epi32_mask(std::bit_cast<__m512i>(v), std::bit_cast<__m512i>(other));
}

using Order = __mmask16;
inline Order order_of(unsigned mask) {
  return static_cast<Order>(mask);
}
/// Not by the instruction that packs into memory: on some processors that takes a hundred times as long.
inline Ints in_order(const Ints& v, Order order) {
  return std::bit_cast<Ints>(_mm512_maskz_compress_epi32(order, std::bit_cast<__m512i>(v)));
}

inline void count_nearer(const Floats& one, const Floats& others, Ints& counts) {
  const __mmask16 farther = _mm512_cmp_ps_mask(std::bit_cast<__m512>(one), std::bit_cast<__m512>(others), _CMP_LT_OQ);
  const __m512i before = std::bit_cast<__m512i>(counts);
  counts = std::bit_cast<Ints>(_mm512_mask_sub_epi32(before, farther, before, _mm512_set1_epi32(-1)));
}

#include "samples/near_kernel_source.h"

}  // namespace

const NearKernel kKernel{&gather, &find, &sort};

}  // namespace lamina::near_v4
