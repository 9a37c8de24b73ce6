// Colours of LAZ: bytes that changed, as differences; those of green and blue are predicted from red's. One code for
// both ways, as integer_codec.h.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "laz/arithmetic_model.h"

namespace lamina::laz {

using Colour = std::array<std::uint16_t, 3>;

constexpr int high_byte(unsigned value) {
  return static_cast<int>(value >> 8);
}
constexpr int low_byte(unsigned value) {
  return static_cast<int>(value & 0xFF);
}

/// The models of both coders, pointwise and layered. What the last colour was is the caller's to know.
class ColourCodec {
 public:
  template <class Coder>
  Colour code(Coder& coder, const Colour& last, const Colour& actual = {}) {
    const unsigned changed = coder.symbol(changed_, Coder::kEncodes ? changes(last, actual) : 0);
    const auto byte = [&](unsigned which, int old, int predicted, int real) {
      if ((changed >> which & 1) == 0) return old;
      const auto difference = static_cast<unsigned>(real - predicted) & 0xFF;
      return (static_cast<int>(coder.symbol(differences_[which], difference)) + predicted) & 0xFF;
    };
    const int red_low = byte(0, low_byte(last[0]), low_byte(last[0]), low_byte(actual[0]));
    const int red_high = byte(1, high_byte(last[0]), high_byte(last[0]), high_byte(actual[0]));
    const auto red = static_cast<std::uint16_t>(red_high << 8 | red_low);
    if ((changed & kColoured) == 0) return {red, red, red};
    int step = red_low - low_byte(last[0]);
    const int green_low = byte(2, low_byte(last[1]), clamped(low_byte(last[1]) + step), low_byte(actual[1]));
    step = (step + green_low - low_byte(last[1])) / 2;
    const int blue_low = byte(4, low_byte(last[2]), clamped(low_byte(last[2]) + step), low_byte(actual[2]));
    step = red_high - high_byte(last[0]);
    const int green_high = byte(3, high_byte(last[1]), clamped(high_byte(last[1]) + step), high_byte(actual[1]));
    step = (step + green_high - high_byte(last[1])) / 2;
    const int blue_high = byte(5, high_byte(last[2]), clamped(high_byte(last[2]) + step), high_byte(actual[2]));
    return {red, static_cast<std::uint16_t>(green_high << 8 | green_low),
            static_cast<std::uint16_t>(blue_high << 8 | blue_low)};
  }

 private:
  static constexpr unsigned kColoured = 1U << 6;

  /// Bits of the bytes that differ; kColoured where the colour is no grey.
  static unsigned changes(const Colour& last, const Colour& actual) {
    unsigned bits = actual[0] != actual[1] || actual[0] != actual[2] ? kColoured : 0;
    for (unsigned k = 0; k < 3; ++k) {
      if (low_byte(last[k]) != low_byte(actual[k])) bits |= 1U << (2 * k);
      if (high_byte(last[k]) != high_byte(actual[k])) bits |= 2U << (2 * k);
    }
    return bits;
  }
  static int clamped(int v) { return std::clamp(v, 0, 255); }

  SymbolModel<128> changed_;
  std::array<SymbolModel<256>, 6> differences_;
};

/// A near infrared value, the same way.
class InfraredCodec {
 public:
  template <class Coder>
  std::uint16_t code(Coder& coder, std::uint16_t last, std::uint16_t actual = 0) {
    const unsigned bits =
        (low_byte(last) != low_byte(actual) ? 1U : 0U) | (high_byte(last) != high_byte(actual) ? 2U : 0U);
    const unsigned changed = coder.symbol(changed_, bits);
    const auto byte = [&](unsigned which, int old, int real) {
      if ((changed >> which & 1) == 0) return old;
      return (old + static_cast<int>(coder.symbol(differences_[which], static_cast<unsigned>(real - old) & 0xFF))) &
             0xFF;
    };
    const int low = byte(0, low_byte(last), low_byte(actual));
    const int high = byte(1, high_byte(last), high_byte(actual));
    return static_cast<std::uint16_t>(high << 8 | low);
  }

 private:
  SymbolModel<4> changed_;
  std::array<SymbolModel<256>, 2> differences_;
};

/// A byte that some program put behind the standard values, the same way.
class ExtraByteCodec {
 public:
  template <class Coder>
  std::uint8_t code(Coder& coder, std::uint8_t last, std::uint8_t actual = 0) {
    return static_cast<std::uint8_t>(last + coder.symbol(model_, static_cast<unsigned>(actual - last) & 0xFF));
  }

 private:
  SymbolModel<256> model_;
};

}  // namespace lamina::laz
