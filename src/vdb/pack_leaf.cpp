#include "vdb/pack_leaf.h"

#include <blosc.h>
#include <immintrin.h>
#include <openvdb/io/Compression.h>

#include <algorithm>
#include <array>
#include <bit>

namespace lamina::volume {
namespace {

void put(std::string& to, const void* from, std::size_t bytes) {
  to.append(static_cast<const char*>(from), bytes);
}

/// As OpenVDB stores arrays: the size compressed and the bytes, or minus the size and the bytes as they are.
void put_compressed(std::string& to, const void* data, std::size_t bytes, std::size_t type_bytes) {
  constexpr int kLevel = 9, kShuffle = 1, kThreads = 1;
  std::array<char, 3 * 512 * sizeof(float) + BLOSC_MAX_OVERHEAD> packed;
  std::int64_t size = blosc_compress_ctx(kLevel, kShuffle, type_bytes, bytes, data, packed.data(), packed.size(),
                                         BLOSC_LZ4_COMPNAME, bytes, kThreads);
  const bool smaller = size > 0 && static_cast<std::size_t>(size) < bytes;
  const std::size_t stored = smaller ? static_cast<std::size_t>(size) : bytes;
  if (!smaller) size = -static_cast<std::int64_t>(bytes);
  put(to, &size, sizeof size);
  put(to, smaller ? packed.data() : data, stored);
}

/// OpenVDB's own, sixteen bits to the nearest, by a table; and the processor's, which gives the same.
void halve(std::span<const float> values, std::uint16_t* out) {
  std::transform(values.begin(), values.end(), out, [](float v) { return openvdb::math::half(v).bits(); });
}
#ifndef __clang__  // which cannot ask for f16c before its version 19
[[gnu::target("avx,f16c")]] void halve_wide(std::span<const float> values, std::uint16_t* out) {
  std::size_t i = 0;
  for (; i + 8 <= values.size(); i += 8) {
    const __m128i eight = _mm256_cvtps_ph(_mm256_loadu_ps(&values[i]), _MM_FROUND_TO_NEAREST_INT);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + i), eight);
  }
  halve(values.subspan(i), out + i);
}
#endif
using Halve = void (*)(std::span<const float> values, std::uint16_t* out);
Halve fastest_halve() {
  __builtin_cpu_init();
#ifndef __clang__
  if (__builtin_cpu_supports("avx") && __builtin_cpu_supports("f16c")) return &halve_wide;
#endif
  return &halve;
}

openvdb::CoordBBox box_of(const openvdb::Coord& origin, const BlockMask& active) {
  std::uint32_t x = 0, y = 0, z = 0;
  for (std::uint32_t i = 0; i < 8; ++i) {
    const std::uint64_t w = active.words[i];
    if (w != 0) x |= 1U << i;
    for (std::uint32_t row = 0; row < 8; ++row) {
      const auto bits = static_cast<std::uint32_t>(w >> (8 * row) & 0xFF);
      if (bits != 0) y |= 1U << row;
      z |= bits;
    }
  }
  const auto low = [](std::uint32_t bits) { return std::countr_zero(bits); };
  const auto high = [](std::uint32_t bits) { return std::bit_width(bits) - 1; };
  if (x == 0) return {};
  return {origin.offsetBy(low(x), low(y), low(z)),
          origin.offsetBy(static_cast<int>(high(x)), static_cast<int>(high(y)), static_cast<int>(high(z)))};
}

}  // namespace

std::array<std::int8_t, 6> face_votes(const BlockMask& active, const BlockMask& negative) {
  // An active voxel's neighbour beyond the leaf must be on its side; the others only guess.
  std::array<int, 6> votes{};
  const auto count = [&](std::size_t face, std::size_t x, std::uint64_t of) {
    const std::uint64_t a = active.words[x], n = negative.words[x];
    votes[face] += 8 * (std::popcount(of & a & ~n) - std::popcount(of & a & n)) + std::popcount(of & ~a & ~n) -
                   std::popcount(of & ~a & n);
  };
  count(0, 0, ~std::uint64_t{0}), count(1, 7, ~std::uint64_t{0});
  for (std::size_t x = 0; x < 8; ++x) {
    count(2, x, 0x00000000000000FFULL), count(3, x, 0xFF00000000000000ULL);
    count(4, x, 0x0101010101010101ULL), count(5, x, 0x8080808080808080ULL);
  }
  std::array<std::int8_t, 6> out{};
  for (std::size_t f = 0; f < 6; ++f) out[f] = static_cast<std::int8_t>(std::clamp(votes[f] / 4, -16, 16));
  return out;
}

void pack(const openvdb::Coord& origin, const LeafMasks& masks, std::span<const float> values, int width, bool half,
          PackedLeaf& out) {
  out.bytes.clear();
  out.faces = {};
  out.origin = origin;
  out.active = static_cast<std::uint32_t>(values.size() / static_cast<std::size_t>(width));
  out.box = box_of(origin, masks.active);
  BlockMask inside, outside;  // of what is not active
  for (std::size_t x = 0; x < 8; ++x) {
    inside.words[x] = masks.inside.words[x] & ~masks.active.words[x];
    outside.words[x] = ~masks.inside.words[x] & ~masks.active.words[x];
  }
  put(out.bytes, masks.active.words.data(), sizeof masks.active.words);
  const char kind = !inside.any()   ? openvdb::io::NO_MASK_OR_INACTIVE_VALS
                    : outside.any() ? openvdb::io::MASK_AND_NO_INACTIVE_VALS
                                    : openvdb::io::NO_MASK_AND_MINUS_BG;
  out.bytes.push_back(kind);
  if (kind == openvdb::io::MASK_AND_NO_INACTIVE_VALS) put(out.bytes, outside.words.data(), sizeof outside.words);
  if (!half) {
    put_compressed(out.bytes, values.data(), values.size_bytes(), sizeof(float));
    return;
  }
  static const Halve halve_fast = fastest_halve();
  std::array<std::uint16_t, 3 * 512> halves;
  halve_fast(values, halves.data());
  put_compressed(out.bytes, halves.data(), values.size() * sizeof halves[0], sizeof halves[0]);
}

}  // namespace lamina::volume
