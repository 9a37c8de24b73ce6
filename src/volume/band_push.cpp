#include "volume/band_push.h"

#include <immintrin.h>

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
    add(p, plane, Reach(plane), channels, sums);
  }
}

/// Pairs as Reach has them, 16 floats for each axis.
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

/// Reach with all pairs at once: the same operations in the same order.
struct WideReach {
  std::uint32_t pairs, behind;
  alignas(64) std::array<float, 16> up, near;

  [[gnu::always_inline, gnu::target("avx512f")]] inline explicit WideReach(const Plane& plane) {
    const __m512 x = _mm512_mul_ps(_mm512_set1_ps(plane[0]), _mm512_load_ps(kWidePairs.x.data()));
    const __m512 y = _mm512_mul_ps(_mm512_set1_ps(plane[1]), _mm512_load_ps(kWidePairs.y.data()));
    const __m512 z = _mm512_mul_ps(_mm512_set1_ps(plane[2]), _mm512_load_ps(kWidePairs.z.data()));
    const __m512 u = _mm512_add_ps(_mm512_add_ps(x, y), z);
    const __m512 left = _mm512_add_ps(_mm512_load_ps(kWidePairs.room.data()), _mm512_mul_ps(u, u));
    _mm512_store_ps(up.data(), u);
    _mm512_store_ps(near.data(), left);
    pairs = _mm512_cmp_ps_mask(left, _mm512_setzero_ps(), _CMP_NLT_UQ);
    behind = _mm512_cmp_ps_mask(u, _mm512_setzero_ps(), _CMP_LT_OQ);
    if (!(plane[3] < 0)) behind = ~behind;
  }
};

[[gnu::target("avx512f")]] void push_wide(std::span<const Pusher> pushers, std::size_t channels, Sums& sums) {
  for (const Pusher& p : pushers) {
    const Plane plane = p.from->plane[p.at];
    add(p, plane, WideReach(plane), channels, sums);
  }
}

}  // namespace

std::vector<Push> available_pushes() {
  __builtin_cpu_init();
  std::vector<Push> out{&push};
  if (__builtin_cpu_supports("avx512f")) out.push_back(&push_wide);
  return out;
}

}  // namespace lamina::volume
