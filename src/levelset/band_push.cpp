#include "levelset/band_push.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>

namespace lamina::volume {
namespace {

template <class Reached>
[[gnu::always_inline]] inline void add(const Pusher& p, const Plane& plane, const Reached& reach, std::size_t channels,
                                       Sums& sums) {
  const std::uint32_t behind = reach.pairs & reach.behind & p.beside.behind;
  const std::uint32_t before = reach.pairs & ~reach.behind & p.beside.before;
  for (std::uint32_t list = behind | before; list != 0; list &= list - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(list));
    const int way = (behind >> i & 1) != 0 ? 1 : -1;
    sums.add(p.here + way * kPairSteps[i], weight_of(reach.near[i]),
             plane + Plane{0, 0, 0, static_cast<float>(way) * reach.up[i]}, *p.from, p.at, channels);
  }
}

void push(std::span<const Pusher> pushers, std::size_t channels, Sums& sums) {
  for (const Pusher& p : pushers) {
    const Plane plane = p.from->plane[p.at];
    add(p, plane, QueryLayers(plane), channels, sums);
  }
}

/// Pairs as QueryLayers has them, 16 floats for each axis.
struct WidePairs {
  alignas(64) std::array<float, 16> x{}, y{}, z{}, room{};
};
constexpr WidePairs make_wide() {
  WidePairs out;
  for (std::size_t i = 0; i < 16; ++i) {
    const Offset o = i < kPairs ? kOffsets[kBehind + i] : Offset{0, 0, 0, 1};
    out.x[i] = static_cast<float>(o.x);
    out.y[i] = static_cast<float>(o.y);
    out.z[i] = static_cast<float>(o.z);
    out.room[i] = kSideways - o.squared;
  }
  return out;
}
constexpr WidePairs kWidePairs = make_wide();

constexpr std::array<std::int32_t, 16> make_wide_steps() {
  std::array<std::int32_t, 16> out{};
  for (std::size_t i = 0; i < kPairs; ++i) out[i] = kPairSteps[i];
  return out;
}
alignas(64) constexpr std::array<std::int32_t, 16> kWideSteps = make_wide_steps();

constexpr std::size_t kFew = 32;  ///< pushers

/// What pushers say to whom, one after the other.
struct Said {
  static constexpr std::size_t kMost = kFew * kPairs + 16;  ///< sixteen are written at once
  std::array<std::int32_t, kMost> to, pusher;
  std::array<float, kMost> up, weight;
};

/// QueryLayers with all pairs at once: the same operations in the same order. First what is said, then the sums: how
/// many there are to each pusher cannot be foretold.
[[gnu::target("avx512f,popcnt")]] void push_few(std::span<const Pusher> pushers, std::size_t channels, Sums& sums) {
  Said said;
  std::array<Plane, kFew> planes;
  std::size_t count = 0;
  const __m512 none = _mm512_setzero_ps();
  const __m512i steps = _mm512_load_si512(kWideSteps.data());
  for (std::size_t n = 0; n < pushers.size(); ++n) {
    const Pusher& p = pushers[n];
    const Plane plane = planes[n] = p.from->plane[p.at];
    const __m512 x = _mm512_mul_ps(_mm512_set1_ps(plane[0]), _mm512_load_ps(kWidePairs.x.data()));
    const __m512 y = _mm512_mul_ps(_mm512_set1_ps(plane[1]), _mm512_load_ps(kWidePairs.y.data()));
    const __m512 z = _mm512_mul_ps(_mm512_set1_ps(plane[2]), _mm512_load_ps(kWidePairs.z.data()));
    const __m512 up = _mm512_add_ps(_mm512_add_ps(x, y), z);
    const __m512 near = _mm512_add_ps(_mm512_load_ps(kWidePairs.room.data()), _mm512_mul_ps(up, up));
    std::uint32_t back = _mm512_cmp_ps_mask(up, none, _CMP_LT_OQ);
    if (!(plane[3] < 0)) back = ~back;
    const std::uint32_t pairs = _mm512_cmp_ps_mask(near, none, _CMP_NLT_UQ);
    const auto before = static_cast<__mmask16>(pairs & ~back & p.beside.before);
    const auto all = static_cast<__mmask16>((pairs & back & p.beside.behind) | before);
    const __m512i to = _mm512_mask_sub_epi32(steps, before, _mm512_setzero_si512(), steps);
    const __m512 square = _mm512_mul_ps(near, near);
    _mm512_storeu_si512(&said.to[count],
                        _mm512_maskz_compress_epi32(all, _mm512_add_epi32(to, _mm512_set1_epi32(p.here))));
    _mm512_storeu_si512(&said.pusher[count], _mm512_set1_epi32(static_cast<std::int32_t>(n)));
    _mm512_storeu_ps(&said.up[count], _mm512_maskz_compress_ps(all, _mm512_mask_sub_ps(up, before, none, up)));
    _mm512_storeu_ps(&said.weight[count],
                     _mm512_maskz_compress_ps(all, _mm512_mul_ps(_mm512_mul_ps(square, near), near)));
    count += static_cast<std::size_t>(std::popcount(static_cast<std::uint32_t>(all)));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const auto n = static_cast<std::size_t>(said.pusher[i]);
    sums.add(said.to[i], said.weight[i], planes[n] + Plane{0, 0, 0, said.up[i]}, *pushers[n].from, pushers[n].at,
             channels);
  }
}

void push_wide(std::span<const Pusher> pushers, std::size_t channels, Sums& sums) {
  for (std::size_t i = 0; i < pushers.size(); i += kFew)
    push_few(pushers.subspan(i, std::min(kFew, pushers.size() - i)), channels, sums);
}

}  // namespace

std::vector<Push> available_pushes() {
  __builtin_cpu_init();
  std::vector<Push> out{&push};
  if (__builtin_cpu_supports("avx512f")) out.push_back(&push_wide);
  return out;
}

}  // namespace lamina::volume
