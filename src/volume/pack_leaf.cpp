#include "volume/pack_leaf.h"

#include <blosc.h>
#include <openvdb/io/Compression.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <vector>

namespace lamina::volume {
namespace {

void put(std::string& to, const void* from, std::size_t bytes) {
  to.append(static_cast<const char*>(from), bytes);
}

/// As OpenVDB stores arrays: the size compressed and the bytes, or minus the size and the bytes as they are.
void put_compressed(std::string& to, const void* data, std::size_t bytes, std::size_t type_bytes) {
  constexpr int kLevel = 9, kShuffle = 1, kThreads = 1;
  const std::size_t at = to.size();
  to.resize(at + sizeof(std::int64_t) + bytes + BLOSC_MAX_OVERHEAD);
  char* const out = to.data() + at + sizeof(std::int64_t);
  std::int64_t size = blosc_compress_ctx(kLevel, kShuffle, type_bytes, bytes, data, out, bytes + BLOSC_MAX_OVERHEAD,
                                         BLOSC_LZ4_COMPNAME, bytes, kThreads);
  if (size <= 0 || static_cast<std::size_t>(size) >= bytes) {
    std::memcpy(out, data, bytes);
    size = -static_cast<std::int64_t>(bytes);
  }
  std::memcpy(to.data() + at, &size, sizeof size);
  to.resize(at + sizeof size + static_cast<std::size_t>(size < 0 ? -size : size));
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

PackedLeaf pack(const openvdb::Coord& origin, const LeafMasks& masks, std::span<const float> values, int width,
                bool half) {
  PackedLeaf out;
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
    return out;
  }
  std::array<openvdb::math::half, 3 * 512> halves;
  std::transform(values.begin(), values.end(), halves.begin(), [](float v) { return openvdb::math::half(v); });
  put_compressed(out.bytes, halves.data(), values.size() * sizeof halves[0], sizeof halves[0]);
  return out;
}

}  // namespace lamina::volume
