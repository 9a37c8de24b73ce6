// Masks of an 8^3 block of cells, corners or voxels.
#pragma once
#include <array>
#include <bit>
#include <cstdint>

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
};

}  // namespace lamina
