// GPS times of LAZ: doubles taken as integers of 64 bits. Up to four sequences of pulses at once, each with its last
// time and the difference between two; a time is coded as a multiple of that difference and a correction.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "laz/arithmetic_decoder.h"
#include "laz/integer_codec.h"

namespace lamina::laz {

/// The pointwise coder has a symbol for a time that stays as it is (kStays); the layered one says so in another layer.
template <bool kStays>
class GpsTimeDecoder {
 public:
  explicit GpsTimeDecoder(std::uint64_t first) : times_{first, 0, 0, 0} {}

  /// The next time. Throws Damaged for a beginning of sequences without end.
  std::uint64_t decode(ArithmeticDecoder& code) {
    for (unsigned switches = 0; switches < kSequences; ++switches) {
      if (differences_[now_] == 0 ? after_none(code) : after_difference(code)) return times_[now_];
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
  bool after_none(ArithmeticDecoder& code) {
    unsigned kind = code.symbol(no_difference_);
    if (kStays) {
      if (kind == 0) return true;
      --kind;
    }
    if (kind == 0) {
      differences_[now_] = corrections_.code(code, 0, 0);
      advance(differences_[now_]);
      extremes_[now_] = 0;
      return true;
    }
    if (kind == 1) return begin_sequence(code);
    now_ = (now_ + kind - 1) % kSequences;
    return false;
  }

  bool after_difference(ArithmeticDecoder& code) {
    const unsigned symbol = code.symbol(multiples_);
    if (symbol == kNew) return begin_sequence(code);
    if (symbol > kNew) {
      now_ = (now_ + symbol - kNew) % kSequences;
      return false;
    }
    if (kStays && symbol == kNew - 1) return true;
    const std::uint32_t last = differences_[now_];
    if (symbol == 1) {
      advance(corrections_.code(code, last, 1));
      extremes_[now_] = 0;
    } else if (symbol == 0) {
      take_extreme(corrections_.code(code, 0, 7));
    } else if (symbol < kMostTimes) {
      advance(corrections_.code(code, symbol * last, symbol < 10 ? 2 : 3));
    } else if (symbol == kMostTimes) {
      take_extreme(corrections_.code(code, kMostTimes * last, 4));
    } else if (symbol < kMostTimes + kMostTimesBack) {
      advance(corrections_.code(code, (kMostTimes - symbol) * last, 5));
    } else {
      take_extreme(corrections_.code(code, (0U - kMostTimesBack) * last, 6));
    }
    return true;
  }

  bool begin_sequence(ArithmeticDecoder& code) {
    newest_ = (newest_ + 1) % kSequences;
    const std::uint64_t high = corrections_.code(code, static_cast<std::uint32_t>(times_[now_] >> 32), 8);
    times_[newest_] = high << 32 | code.bits(32);
    now_ = newest_;
    differences_[now_] = 0;
    extremes_[now_] = 0;
    return true;
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
