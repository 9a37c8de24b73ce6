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

inline unsigned not_above(const Floats& v, float most) {
  return bits_of(v <= most);
}
inline unsigned below(const Ints& v, std::int32_t end) {
  return bits_of(v < end);
}
inline unsigned equal(const Ints& v, const Ints& other) {
  return bits_of(v == other);
}

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

class Packed {
 public:
  explicit Packed(unsigned mask) : mask_(mask) { __builtin_memcpy(&bytes_, kBytes[mask].data(), sizeof(bytes_)); }
  [[nodiscard]] std::size_t count() const { return static_cast<std::size_t>(__builtin_popcount(mask_)); }
  template <class V>
  void write(const V& v, void* to) const {
    const __m128i packed = _mm_shuffle_epi8(std::bit_cast<__m128i>(v), bytes_);
    __builtin_memcpy(to, &packed, sizeof(packed));
  }

 private:
  unsigned mask_;
  __m128i bytes_;
};

inline void count_nearer(const Floats& one, const Floats& others, Ints& counts) {
  counts -= one < others;
}

#include "samples/near_kernel_source.h"

}  // namespace

const NearKernel kKernel{&gather, &find, &sort};

}  // namespace lamina::near_v2
