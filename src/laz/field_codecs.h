// How LAZ codes fields: integers, colours and GPS times. One code for both ways: a decoder ignores the values that it
// is given, and an encoder gives them back.
//
// Integers are coded as corrections of a prediction: first the number of bits k of the correction, then the
// correction among those of k bits, its upper eight bits by a model and the rest as they are.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "laz/arithmetic_coder.h"

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

// Colours of LAZ: bytes that changed, as differences; those of green and blue are predicted from red's.

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

// GPS times of LAZ: doubles taken as integers of 64 bits. Up to four sequences of pulses at once, each with its last
// time and the difference between two; a time is coded as a multiple of that difference and a correction.

/// The pointwise coder has a symbol for a time that stays as it is (kStays); the layered one says so in another layer,
/// and only that one is written.
template <bool kStays>
class GpsTimeCodec {
 public:
  explicit GpsTimeCodec(std::uint64_t first) : times_{first, 0, 0, 0} {}

  /// The next time. Throws Damaged for a beginning of sequences without end.
  template <class Coder>
  std::uint64_t code(Coder& coder, std::uint64_t actual = 0) {
    for (unsigned switches = 0; switches < kSequences; ++switches) {
      if (differences_[now_] == 0 ? after_none(coder, actual) : after_difference(coder, actual)) return times_[now_];
    }
    throw Damaged("its GPS times go from sequence to sequence");
  }

 private:
  static constexpr unsigned kSequences = 4;
  static constexpr unsigned kMostTimes = 500;     ///< multiples 0 to 500,
  static constexpr unsigned kMostTimesBack = 10;  ///< and -1 to -10
  static constexpr unsigned kSame = 1;            ///< symbols for a time that stays
  static constexpr unsigned kNew = kMostTimes + kMostTimesBack + 1 + (kStays ? kSame : 0);
  static constexpr unsigned kMultiples = kNew + kSequences;
  static constexpr unsigned kNoDifference = 2 + (kSequences - 1) + (kStays ? kSame : 0);
  static constexpr std::uint32_t kMostExtremes = 3;

  /// Both return false when they went to another sequence, where the time is yet to come.
  template <class Coder>
  bool after_none(Coder& coder, std::uint64_t actual) {
    unsigned kind = 0;
    if (Coder::kEncodes && !follows(now_, actual)) kind = 1 + steps_to_sequence(actual);
    kind = coder.symbol(no_difference_, kind);
    if (kStays) {
      if (kind == 0) return true;
      --kind;
    }
    if (kind == 0) {
      differences_[now_] = corrections_.code(coder, 0, 0, difference(actual));
      advance(differences_[now_]);
      extremes_[now_] = 0;
      return true;
    }
    if (kind == 1) return begin_sequence(coder, actual);
    now_ = (now_ + kind - 1) % kSequences;
    return false;
  }

  template <class Coder>
  bool after_difference(Coder& coder, std::uint64_t actual) {
    const std::uint32_t last = differences_[now_];
    unsigned symbol = 0;
    if (Coder::kEncodes) symbol = follows(now_, actual) ? multiple(actual) : kNew + steps_to_sequence(actual);
    symbol = coder.symbol(multiples_, symbol);
    if (symbol == kNew) return begin_sequence(coder, actual);
    if (symbol > kNew) {
      now_ = (now_ + symbol - kNew) % kSequences;
      return false;
    }
    if (kStays && symbol == kNew - 1) return true;
    const auto correct = [&](std::uint32_t predicted, unsigned context) {
      return corrections_.code(coder, predicted, context, difference(actual));
    };
    if (symbol == 1) {
      advance(correct(last, 1));
      extremes_[now_] = 0;
    } else if (symbol == 0) {
      take_extreme(correct(0, 7));
    } else if (symbol < kMostTimes) {
      advance(correct(symbol * last, symbol < 10 ? 2 : 3));
    } else if (symbol == kMostTimes) {
      take_extreme(correct(kMostTimes * last, 4));
    } else if (symbol < kMostTimes + kMostTimesBack) {
      advance(correct((kMostTimes - symbol) * last, 5));
    } else {
      take_extreme(correct((0U - kMostTimesBack) * last, 6));
    }
    return true;
  }

  template <class Coder>
  bool begin_sequence(Coder& coder, std::uint64_t actual) {
    newest_ = (newest_ + 1) % kSequences;
    const std::uint64_t high = corrections_.code(coder, static_cast<std::uint32_t>(times_[now_] >> 32), 8,
                                                 static_cast<std::uint32_t>(actual >> 32));
    times_[newest_] = high << 32 | coder.bits(32, static_cast<std::uint32_t>(actual));
    now_ = newest_;
    differences_[now_] = 0;
    extremes_[now_] = 0;
    return true;
  }

  /// From the last time of the present sequence; its lower half, where follows().
  [[nodiscard]] std::uint32_t difference(std::uint64_t actual) const {
    return static_cast<std::uint32_t>(actual - times_[now_]);
  }
  /// Whether the time's difference from the sequence's last is one that corrections have room for.
  [[nodiscard]] bool follows(unsigned sequence, std::uint64_t actual) const {
    const auto apart = static_cast<std::int64_t>(actual - times_[sequence]);
    return apart == static_cast<std::int32_t>(apart);
  }
  /// From the present sequence to one that the time follows; 0 for none.
  [[nodiscard]] unsigned steps_to_sequence(std::uint64_t actual) const {
    for (unsigned steps = 1; steps < kSequences; ++steps) {
      if (follows((now_ + steps) % kSequences, actual)) return steps;
    }
    return 0;
  }
  /// The symbol of the multiple that comes nearest to the time.
  [[nodiscard]] unsigned multiple(std::uint64_t actual) const {
    const auto times = std::lround(static_cast<double>(static_cast<std::int32_t>(difference(actual))) /
                                   static_cast<double>(static_cast<std::int32_t>(differences_[now_])));
    if (times < 0) return kMostTimes + static_cast<unsigned>(std::min<long>(-times, kMostTimesBack));
    return static_cast<unsigned>(std::min<long>(times, kMostTimes));
  }

  void advance(std::uint32_t difference) {
    times_[now_] += static_cast<std::uint64_t>(std::int64_t{static_cast<std::int32_t>(difference)});
  }
  /// A difference that is no multiple becomes the sequence's own when it comes again and again.
  void take_extreme(std::uint32_t difference) {
    advance(difference);
    if (++extremes_[now_] <= kMostExtremes) return;
    differences_[now_] = difference;
    extremes_[now_] = 0;
  }

  std::array<std::uint64_t, kSequences> times_;
  std::array<std::uint32_t, kSequences> differences_{}, extremes_{};
  unsigned now_ = 0, newest_ = 0;
  SymbolModel<kMultiples> multiples_;
  SymbolModel<kNoDifference> no_difference_;
  IntegerCodec<32, 9> corrections_;
};

}  // namespace lamina::laz
