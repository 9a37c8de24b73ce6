// Numbers that look random: a hash of cells, and a generator that is a function of its counter.
#pragma once
#include <cstddef>
#include <cstdint>

namespace lamina {

/// One number for a cell's place, for tables of cells. Odd multipliers spread neighbouring cells; the shift brings the
/// well mixed upper bits down.
constexpr std::size_t cell_hash(std::int64_t x, std::int64_t y, std::int64_t z) {
  const std::uint64_t mixed = static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15U ^
                              static_cast<std::uint64_t>(y) * 0xC2B2AE3D27D4EB4FU ^
                              static_cast<std::uint64_t>(z) * 0x165667B19E3779F9U;
  return static_cast<std::size_t>(mixed ^ mixed >> 32);
}

/// Every bit of the result depends on every bit of `n` (the finishing steps of MurmurHash3).
constexpr std::uint64_t scrambled(std::uint64_t n) {
  n ^= n >> 33U;
  n *= 0xff51afd7ed558ccdU;
  n ^= n >> 33U;
  n *= 0xc4ceb9fe1a85ec53U;
  return n ^ (n >> 33U);
}

/// Random numbers as a function of (seed, sample, draw): any sample can be made on any thread, in any order. The
/// counter goes twice through the finaliser of SplitMix64 (Steele, Lea, Flood 2014).
class CounterRng {
 public:
  CounterRng(std::uint64_t seed, std::uint64_t sample) : key_(mix(mix(seed + kGolden) ^ (sample * kGolden))) {}
  std::uint64_t bits() { return mix(key_ + ++draw_ * kGolden); }
  /// Uniform in [0, 1), 53 bits.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  /// Uniform in [-1, 1).
  double symmetric() { return 2 * uniform() - 1; }

 private:
  static constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15ull;
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  std::uint64_t key_;
  std::uint64_t draw_ = 0;
};

}  // namespace lamina
