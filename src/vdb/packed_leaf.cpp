#include "vdb/packed_leaf.h"

#include <blosc.h>
#include <openvdb/io/Compression.h>

#include <algorithm>
#include <array>
#include <bit>

#include "lattice/morphology.h"

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
  std::array<std::int8_t, 6> out{};
  for (int f = 0; f < 6; ++f) {
    const BlockMask on_face = bits::face(2 - f / 2, f % 2 != 0);  // OpenVDB's last axis is the masks' first
    const BlockMask sure = active & on_face, guessed = on_face & ~active;
    const int votes =
        8 * (sure.count() - 2 * (sure & negative).count()) + guessed.count() - 2 * (guessed & negative).count();
    out[static_cast<std::size_t>(f)] = static_cast<std::int8_t>(std::clamp(votes / 4, -16, 16));
  }
  return out;
}

std::array<std::int8_t, 6> face_votes(const openvdb::FloatTree::LeafNodeType& leaf) {
  BlockMask active, negative;
  for (int at = 0; at < 512; ++at) {
    const auto voxel = static_cast<openvdb::Index>(at);
    active.assign(at, leaf.isValueOn(voxel));
    negative.assign(at, leaf.getValue(voxel) < 0);
  }
  return face_votes(active, negative);
}

void pack(const openvdb::Coord& origin, const LeafMasks& masks, std::span<const float> values, int width, bool half,
          PackedLeaf& out) {
  out.bytes.clear();
  out.faces = {};
  out.origin = origin;
  out.active = static_cast<std::uint32_t>(values.size() / static_cast<std::size_t>(width));
  out.box = box_of(origin, masks.active);
  const BlockMask inside = masks.inside & ~masks.active, outside = ~masks.inside & ~masks.active;
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
  std::array<std::uint16_t, 3 * 512> halves;
  std::transform(values.begin(), values.end(), halves.begin(), [](float v) { return openvdb::math::half(v).bits(); });
  put_compressed(out.bytes, halves.data(), values.size() * sizeof halves[0], sizeof halves[0]);
}

}  // namespace lamina::volume
