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

inline unsigned not_above(const Floats& v, float most) {
  return bits_of(v <= most);
}
inline unsigned below(const Ints& v, std::int32_t end) {
  return bits_of(v < end);
}
inline unsigned equal(const Ints& v, const Ints& other) {
  return bits_of(v == other);
}

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

class Packed {
 public:
  explicit Packed(unsigned mask)
      : mask_(mask), lanes_(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kListed[mask])))) {}
  [[nodiscard]] std::size_t count() const { return static_cast<std::size_t>(__builtin_popcount(mask_)); }
  template <class V>
  void write(const V& v, void* to) const {
    const __m256i packed = _mm256_permutevar8x32_epi32(std::bit_cast<__m256i>(v), lanes_);
    __builtin_memcpy(to, &packed, sizeof(packed));
  }

 private:
  unsigned mask_;
  __m256i lanes_;
};

inline void count_nearer(const Floats& one, const Floats& others, Ints& counts) {
  counts -= one < others;
}

#include "samples/near_kernel_source.h"

}  // namespace

const NearKernel kKernel{&gather, &find, &sort};

}  // namespace lamina::near_v3
