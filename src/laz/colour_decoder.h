// Colours of LAZ: bytes that changed, as differences; those of green and blue are predicted from red's.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "laz/arithmetic_decoder.h"

namespace lamina::laz {

using Colour = std::array<std::uint16_t, 3>;

/// The models of both coders, pointwise and layered. What the last colour was is the caller's to know.
class ColourDecoder {
 public:
  Colour decode(ArithmeticDecoder& code, const Colour& last) {
    const unsigned changed = code.symbol(changed_);
    const auto high = [](unsigned v) { return static_cast<int>(v >> 8); };
    const auto low = [](unsigned v) { return static_cast<int>(v & 0xFF); };
    const auto byte = [&](unsigned which, int old, int predicted) {
      return (changed >> which & 1) == 0 ? old
                                         : (static_cast<int>(code.symbol(differences_[which])) + predicted) & 0xFF;
    };
    const int red_low = byte(0, low(last[0]), low(last[0]));
    const int red_high = byte(1, high(last[0]), high(last[0]));
    const auto red = static_cast<std::uint16_t>(red_high << 8 | red_low);
    constexpr unsigned kColoured = 1U << 6;
    if ((changed & kColoured) == 0) return {red, red, red};
    int step = red_low - low(last[0]);
    const int green_low = byte(2, low(last[1]), clamped(low(last[1]) + step));
    step = (step + green_low - low(last[1])) / 2;
    const int blue_low = byte(4, low(last[2]), clamped(low(last[2]) + step));
    step = red_high - high(last[0]);
    const int green_high = byte(3, high(last[1]), clamped(high(last[1]) + step));
    step = (step + green_high - high(last[1])) / 2;
    const int blue_high = byte(5, high(last[2]), clamped(high(last[2]) + step));
    return {red, static_cast<std::uint16_t>(green_high << 8 | green_low),
            static_cast<std::uint16_t>(blue_high << 8 | blue_low)};
  }

 private:
  static int clamped(int v) { return std::clamp(v, 0, 255); }

  SymbolModel<128> changed_;
  std::array<SymbolModel<256>, 6> differences_;
};

/// A near infrared value, the same way.
class InfraredDecoder {
 public:
  std::uint16_t decode(ArithmeticDecoder& code, std::uint16_t last) {
    const unsigned changed = code.symbol(changed_);
    unsigned low = last & 0xFFU;
    unsigned high = static_cast<unsigned>(last) >> 8;
    if ((changed & 1) != 0) low = (low + code.symbol(differences_[0])) & 0xFF;
    if ((changed & 2) != 0) high = (high + code.symbol(differences_[1])) & 0xFF;
    return static_cast<std::uint16_t>(high << 8 | low);
  }

 private:
  SymbolModel<4> changed_;
  std::array<SymbolModel<256>, 2> differences_;
};

}  // namespace lamina::laz
