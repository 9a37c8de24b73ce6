// Integers of LAZ, coded as corrections of a prediction: first the number of bits k of the correction, then the
// correction among those of k bits, its upper eight bits by a model and the rest as they are. One code for both ways:
// a decoder ignores the values that it is given, and an encoder gives them back.
#pragma once
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "laz/arithmetic_model.h"

namespace lamina::laz {

/// Of kBits bits. Arithmetic is modulo 2^32: of fewer bits take the lower ones.
template <unsigned kBits, unsigned kContexts>
class IntegerCodec {
 public:
  IntegerCodec() {
    for (unsigned k = 1; k < kByModel; ++k) corrections_[k - 1] = SymbolModel<256>(1U << k);
  }

  template <class Coder>
  std::uint32_t code(Coder& coder, std::uint32_t predicted, unsigned context, std::uint32_t actual = 0) {
    std::uint32_t c = 0;
    if constexpr (Coder::kEncodes) {
      const std::int32_t correction = folded(actual - predicted);
      const std::uint32_t size =
          correction <= 0 ? 0U - static_cast<std::uint32_t>(correction) : static_cast<std::uint32_t>(correction) - 1;
      k_ = static_cast<unsigned>(std::bit_width(size));
      c = static_cast<std::uint32_t>(correction);
      if (k_ > 0 && k_ < 32) c = correction < 0 ? c + ((1U << k_) - 1) : c - 1;
    }
    k_ = coder.symbol(magnitudes_[context], k_);
    if (k_ == 0) return predicted + coder.bit(one_, c);
    if (k_ == 32) return predicted + 0x80000000U;
    if (k_ <= kByModel) {
      c = coder.symbol(corrections_[k_ - 1], c);
    } else {
      const unsigned low_bits = k_ - kByModel;
      const std::uint32_t high = coder.symbol(corrections_[k_ - 1], c >> low_bits);
      c = high << low_bits | coder.bits(low_bits, c & ((1U << low_bits) - 1));
    }
    // Corrections of k bits are those from -(2^k - 1) to -2^(k-1), and from 2^(k-1) + 1 to 2^k.
    return predicted + (c >= 1U << (k_ - 1) ? c + 1 : c - ((1U << k_) - 1));
  }

  /// Bits of the last correction: how well the prediction was met.
  [[nodiscard]] unsigned magnitude() const { return k_; }

 private:
  static constexpr unsigned kByModel = 8;

  /// The difference nearest to 0 that comes to the same modulo 2^kBits.
  static std::int32_t folded(std::uint32_t difference) {
    constexpr unsigned kUnused = 32 - kBits;
    return static_cast<std::int32_t>(difference << kUnused) >> kUnused;
  }

  std::array<SymbolModel<kBits + 1>, kContexts> magnitudes_;
  BitModel one_;
  std::array<SymbolModel<256>, kBits> corrections_;
  unsigned k_ = 0;
};

}  // namespace lamina::laz
