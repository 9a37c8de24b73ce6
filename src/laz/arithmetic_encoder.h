// The arithmetic encoder of LAZ, the other way of the decoder: it has the same calls, which take what those give.
#pragma once
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "laz/arithmetic_model.h"

namespace lamina::laz {

class ArithmeticEncoder {
 public:
  static constexpr bool kEncodes = true;

  template <unsigned kMost>
  unsigned symbol(SymbolModel<kMost>& model, unsigned symbol) {
    const std::uint32_t unit = length_ >> kSymbolBits;
    const std::uint32_t low = model.start(symbol) * unit;
    length_ = (model.is_last(symbol) ? length_ : model.start(symbol + 1) * unit) - low;
    advance(low);
    model.count(symbol);
    renormalise();
    return symbol;
  }

  unsigned bit(BitModel& model, unsigned bit) {
    const std::uint32_t split = model.zero() * (length_ >> kBitBits);
    advance(bit != 0 ? split : 0);
    length_ = bit != 0 ? length_ - split : split;
    model.count(bit);
    renormalise();
    return bit;
  }

  /// 1 to 32 bits, all values alike.
  std::uint32_t bits(unsigned count, std::uint32_t value) {
    constexpr unsigned kAtOnce = 19;
    constexpr unsigned kLow = 16;
    if (count <= kAtOnce) {
      few_bits(count, value);
    } else {
      few_bits(kLow, value & ((1U << kLow) - 1));
      few_bits(count - kLow, value >> kLow);
    }
    return value;
  }

  /// All bytes; nothing can be added. Zeros at the end are those that a decoder reads ahead.
  std::vector<std::byte> finish() {
    const bool is_long = length_ > 2 * kShortest;
    advance(is_long ? kShortest : kShortest / 2);
    length_ = is_long ? kShortest / 2 : kShortest >> 9;
    renormalise();
    bytes_.insert(bytes_.end(), is_long ? 3 : 2, std::byte{});
    return std::move(bytes_);
  }

 private:
  static constexpr std::uint32_t kShortest = 1U << 24;

  void few_bits(unsigned count, std::uint32_t value) {
    length_ >>= count;
    advance(value * length_);
    renormalise();
  }
  void advance(std::uint32_t by) {
    base_ += by;
    if (base_ >= by) return;
    // Carries into the bytes that are out: there is one below 255, as all of them together are a fraction below 1.
    std::size_t at = bytes_.size() - 1;
    for (; bytes_[at] == std::byte{0xFF}; --at) bytes_[at] = std::byte{};
    bytes_[at] = static_cast<std::byte>(std::to_integer<unsigned>(bytes_[at]) + 1);
  }
  void renormalise() {
    while (length_ < kShortest) {
      bytes_.push_back(static_cast<std::byte>(base_ >> 24));
      base_ <<= 8;
      length_ <<= 8;
    }
  }

  std::vector<std::byte> bytes_;
  std::uint32_t base_ = 0, length_ = 0xFFFFFFFF;
};

}  // namespace lamina::laz
