// Integers of LAZ, coded as corrections of a prediction: first the number of bits k of the correction, then the
// correction among those of k bits, its upper eight bits by a model and the rest as they are.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "laz/arithmetic_decoder.h"

namespace lamina::laz {

/// Of kBits bits. Arithmetic is modulo 2^32: of fewer bits take the lower ones.
template <unsigned kBits, unsigned kContexts>
class IntegerDecoder {
 public:
  IntegerDecoder() {
    for (unsigned k = 1; k < kByModel; ++k) corrections_[k - 1] = SymbolModel<256>(1U << k);
  }

  std::uint32_t decode(ArithmeticDecoder& code, std::uint32_t predicted, unsigned context) {
    k_ = code.symbol(magnitudes_[context]);
    if (k_ == 0) return predicted + code.bit(one_);
    if (k_ == 32) return predicted + 0x80000000U;
    std::uint32_t c = code.symbol(corrections_[k_ - 1]);
    if (k_ > kByModel) c = c << (k_ - kByModel) | code.bits(k_ - kByModel);
    // Corrections of k bits are those from -(2^k - 1) to -2^(k-1), and from 2^(k-1) + 1 to 2^k.
    return predicted + (c >= 1U << (k_ - 1) ? c + 1 : c - ((1U << k_) - 1));
  }

  /// Bits of the last correction: how well the prediction was met.
  [[nodiscard]] unsigned magnitude() const { return k_; }

 private:
  static constexpr unsigned kByModel = 8;

  std::array<SymbolModel<kBits + 1>, kContexts> magnitudes_;
  BitModel one_;
  std::array<SymbolModel<256>, kBits> corrections_;
  unsigned k_ = 0;
};

}  // namespace lamina::laz
