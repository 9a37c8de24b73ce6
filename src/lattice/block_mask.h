// Masks of an 8^3 block of cells, corners or voxels.
#pragma once
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace lamina {

/// 512 bits, a 64-bit word per layer z; bit x + 8 y inside a word. OpenVDB's own linear order with its i axis as z:
/// Coord(z, y, x), so that a slab is a run of words. A cache line, whole.
struct alignas(64) BlockMask {
  std::array<std::uint64_t, 8> words{};

  static constexpr int offset(int x, int y, int z) { return x + (y << 3) + (z << 6); }
  [[nodiscard]] bool test(int offset) const { return ((words[offset >> 6] >> (offset & 63)) & 1U) != 0; }
  void set(int offset) { words[offset >> 6] |= std::uint64_t{1} << (offset & 63); }
  void reset(int offset) { words[offset >> 6] &= ~(std::uint64_t{1} << (offset & 63)); }
  void assign(int offset, bool on) { on ? set(offset) : reset(offset); }
  [[nodiscard]] bool any() const {
    std::uint64_t all = 0;
    for (const std::uint64_t w : words) all |= w;
    return all != 0;
  }
  [[nodiscard]] int count() const {
    int n = 0;
    for (const std::uint64_t w : words) n += std::popcount(w);
    return n;
  }

  bool operator==(const BlockMask&) const = default;
  BlockMask& operator|=(const BlockMask& o) {
    for (std::size_t z = 0; z < 8; ++z) words[z] |= o.words[z];
    return *this;
  }
  BlockMask& operator&=(const BlockMask& o) {
    for (std::size_t z = 0; z < 8; ++z) words[z] &= o.words[z];
    return *this;
  }
  // By reference: values this large come with a remark of GCC's on its calling conventions.
  friend BlockMask operator|(const BlockMask& a, const BlockMask& b) { return BlockMask(a) |= b; }
  friend BlockMask operator&(const BlockMask& a, const BlockMask& b) { return BlockMask(a) &= b; }
  friend BlockMask operator~(const BlockMask& a) {
    BlockMask out;
    for (std::size_t z = 0; z < 8; ++z) out.words[z] = ~a.words[z];
    return out;
  }
};

/// Exchanges x and y: every word is a matrix of 8 x 8 bits.
inline void swap_x_y(BlockMask& mask) {
  for (std::uint64_t& w : mask.words) {
    const auto exchange = [&w](int by, std::uint64_t which) {
      const std::uint64_t t = (w ^ (w >> by)) & which;
      w ^= t ^ (t << by);
    };
    exchange(7, 0x00AA00AA00AA00AAULL);
    exchange(14, 0x0000CCCC0000CCCCULL);
    exchange(28, 0x00000000F0F0F0F0ULL);
  }
}

/// Exchanges y and z: a matrix of 8 x 8 bytes.
inline void swap_y_z(BlockMask& mask) {
  const BlockMask from = mask;
  for (int y = 0; y < 8; ++y) {
    std::uint64_t w = 0;
    for (int z = 0; z < 8; ++z) w |= (from.words[z] >> (8 * y) & 0xFF) << (8 * z);
    mask.words[y] = w;
  }
}

/// The mask with its axes exchanged; `to`: where axis x, y, z go, 0 for x.
inline BlockMask with_axes(const BlockMask& of, std::array<int, 3> to) {
  BlockMask mask = of;
  const auto sort_lower = [&] {
    if (to[0] > to[1]) std::swap(to[0], to[1]), swap_x_y(mask);
  };
  sort_lower();
  if (to[1] > to[2]) std::swap(to[1], to[2]), swap_y_z(mask);
  sort_lower();
  return mask;
}

}  // namespace lamina
