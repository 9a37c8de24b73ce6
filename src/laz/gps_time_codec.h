// GPS times of LAZ: doubles taken as integers of 64 bits. Up to four sequences of pulses at once, each with its last
// time and the difference between two; a time is coded as a multiple of that difference and a correction. One code for
// both ways, as integer_codec.h.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "laz/arithmetic_decoder.h"
#include "laz/integer_codec.h"

namespace lamina::laz {

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
