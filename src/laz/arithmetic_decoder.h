// The arithmetic decoder of LAZ: symbols and bits out of a run of bytes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>

#include "laz/arithmetic_model.h"

namespace lamina::laz {

/// What is wrong with compressed bytes, without file and place.
struct Damaged : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Interval [0, length) of 32 bits and a value in it. Throws Damaged when the bytes end too early. Decode through a
/// copy on the stack: the compiler keeps it in registers.
class ArithmeticDecoder {
 public:
  static constexpr bool kEncodes = false;

  ArithmeticDecoder() = default;
  /// Throws Damaged also for a beginning that no encoder writes.
  explicit ArithmeticDecoder(std::span<const std::byte> code) : next_(code.data()), end_(next_ + code.size()) {
    for (int i = 0; i < 4; ++i) value_ = value_ << 8 | byte();
    if (value_ == length_) throw Damaged("the compressed bytes begin like none");
  }

  template <unsigned kMost>
  unsigned symbol(SymbolModel<kMost>& model, unsigned = 0) {
    const std::uint32_t unit = length_ >> kSymbolBits;
    const unsigned symbol = model.at(value_ / unit);
    const std::uint32_t low = model.start(symbol) * unit;
    const std::uint32_t high = model.is_last(symbol) ? length_ : model.start(symbol + 1) * unit;
    value_ -= low;
    length_ = high - low;
    model.count(symbol);
    renormalise();
    return symbol;
  }

  unsigned bit(BitModel& model, unsigned = 0) {
    const std::uint32_t split = model.zero() * (length_ >> kBitBits);
    const unsigned bit = value_ >= split ? 1 : 0;
    value_ -= bit != 0 ? split : 0;
    length_ = bit != 0 ? length_ - split : split;
    model.count(bit);
    renormalise();
    return bit;
  }

  /// 1 to 32 bits, all values alike.
  std::uint32_t bits(unsigned count, std::uint32_t = 0) {
    constexpr unsigned kAtOnce = 19;
    constexpr unsigned kLow = 16;
    if (count <= kAtOnce) return few_bits(count);
    const std::uint32_t low = few_bits(kLow);
    return low | few_bits(count - kLow) << kLow;
  }

  /// Bytes that are left; an encoder writes as many as its decoder takes.
  [[nodiscard]] std::size_t left() const { return static_cast<std::size_t>(end_ - next_); }

 private:
  static constexpr std::uint32_t kShortest = 1U << 24;

  std::uint32_t few_bits(unsigned count) {
    length_ >>= count;
    const std::uint32_t value = value_ / length_;
    if (value >> count != 0) throw Damaged("it holds a number that is too large");
    value_ -= value * length_;
    renormalise();
    return value;
  }
  void renormalise() {
    while (length_ < kShortest) {
      value_ = value_ << 8 | byte();
      length_ <<= 8;
    }
  }
  std::uint32_t byte() {
    if (next_ == end_) throw Damaged("the compressed bytes end too early");
    return std::to_integer<std::uint32_t>(*next_++);
  }

  const std::byte* next_ = nullptr;
  const std::byte* end_ = nullptr;
  std::uint32_t value_ = 0, length_ = 0xFFFFFFFF;
};

}  // namespace lamina::laz
