// What the coders of LAZ look at: the return of a point, and the differences of coordinates before it.
//
// Which models are taken for a point goes by its number of returns n and its return number r, from 0 as some files have
// them.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/number.h"
#include "laz/layers.h"

namespace lamina::laz {

/// One of six contexts of coordinates for the layered coder, [n][r] of 4 bits each.
inline constexpr std::array<std::array<std::uint8_t, 16>, 16> kReturnContext{{
    {0, 1, 2, 3, 4, 5, 3, 4, 4, 5, 5, 5, 5, 5, 5, 5},
    {1, 0, 1, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3},
    {2, 1, 2, 4, 4, 4, 4, 4, 4, 4, 4, 3, 3, 3, 3, 3},
    {3, 3, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {4, 3, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {5, 3, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {3, 3, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4, 4},
    {4, 3, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4, 4},
    {4, 3, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4, 4},
    {5, 3, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4, 4},
    {5, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 4, 4, 4, 4, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 4, 4, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5, 4},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5, 5},
    {5, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5, 5},
}};

/// One of sixteen for the pointwise coder, [n][r] of 3 bits each.
inline constexpr std::array<std::array<std::uint8_t, 8>, 8> kOldReturnContext{{
    {15, 14, 13, 12, 11, 10, 9, 8},
    {14, 0, 1, 3, 6, 10, 10, 9},
    {13, 1, 2, 4, 7, 11, 11, 10},
    {12, 3, 4, 5, 8, 12, 12, 11},
    {11, 6, 7, 8, 9, 13, 13, 12},
    {10, 10, 11, 12, 13, 14, 14, 13},
    {9, 10, 11, 12, 13, 14, 15, 14},
    {8, 9, 10, 11, 12, 13, 14, 15},
}};

/// How many returns of its pulse come after a point, up to seven: heights are predicted from points of the same.
constexpr unsigned return_level(unsigned n, unsigned r) {
  return std::min(n > r ? n - r : r - n, 7U);
}

/// The even number not above k, up to `most`: what coordinates' contexts make of the size of a correction.
constexpr unsigned magnitude_context(unsigned k, unsigned most) {
  return k < most ? k & ~1U : most;
}

// The predictor of coordinates in LAZ: of about the last five differences the one in the middle.

/// Five values in order. A new one takes the place of the highest and the lowest by turns; which turn it is changes
/// when the value was on the other side of the median.
class RunningMedian {
 public:
  [[nodiscard]] std::uint32_t get() const { return static_cast<std::uint32_t>(values_[2]); }

  void add(std::uint32_t difference) {
    const auto value = static_cast<std::int32_t>(difference);
    const bool above = drops_highest_ ? value >= values_[2] : value > values_[2];
    if (drops_highest_) {
      insert_from_above(value);
      if (above) drops_highest_ = false;
    } else {
      insert_from_below(value);
      if (!above) drops_highest_ = true;
    }
  }

 private:
  void insert_from_above(std::int32_t value) {
    std::size_t at = 4;
    for (; at > 0 && value < values_[at - 1]; --at) values_[at] = values_[at - 1];
    values_[at] = value;
  }
  void insert_from_below(std::int32_t value) {
    std::size_t at = 0;
    for (; at < 4 && values_[at + 1] < value; ++at) values_[at] = values_[at + 1];
    values_[at] = value;
  }

  std::array<std::int32_t, 5> values_{};
  bool drops_highest_ = true;
};

// The first layer: where every point lies, which return of its pulse it is, and what else is new about it. One code for
// both ways, as field_codecs.h.

/// Returns, x and y, and which other values change.
class CoreLayer {
 public:
  explicit CoreLayer(const std::byte* first)
      : channels_(channel_in(first), value_in(first)), flags_(first[kFlags] & ~kChannel) {}

  /// Tells the other layers in `contexts`, one for each record.
  template <class Coder>
  void code(Coder& coder, std::size_t count, PointContext* contexts, std::byte* records, std::size_t stride) {
    for (std::size_t i = 0; i < count; ++i, records += stride) {
      const Value actual = Coder::kEncodes ? value_in(records) : Value{};
      State& state = code_changes(coder, actual, Coder::kEncodes ? channel_in(records) : 0, contexts[i]);
      code_place(coder, state, actual, contexts[i]);
      state.time_changed = contexts[i].time_changed;
      if constexpr (Coder::kEncodes) {
        state.last = actual;
      } else {
        store_little(records, state.last.x);
        store_little(records + 4, state.last.y);
        records[kReturns] = static_cast<std::byte>(state.last.n << 4 | state.last.r);
        records[kFlags] = flags_ | static_cast<std::byte>(contexts[i].channel << 4);
      }
    }
  }

 private:
  static constexpr std::size_t kReturns = 14, kFlags = 15, kAngle = 18, kSource = 20, kTime = 22;
  static constexpr std::byte kChannel{0x30};
  /// Bits of the symbol that tells what changed.
  static constexpr unsigned kChannelChanged = 1 << 6, kSourceChanged = 1 << 5, kTimeChanged = 1 << 4,
                            kAngleChanged = 1 << 3, kNumberChanged = 1 << 2, kReturnChange = 3;

  struct Value {
    std::uint32_t x = 0, y = 0;
    unsigned n = 0, r = 0;                ///< number of returns, return number
    std::uint16_t angle = 0, source = 0;  ///< these three are known to an encoder alone
    std::uint64_t time = 0;
  };
  struct State {
    explicit State(const Value& first) : last(first) {}
    [[nodiscard]] const Value& value() const { return last; }

    Value last;
    bool time_changed = false;
    std::array<RunningMedian, 12> x_steps, y_steps;
    std::array<SymbolModel<128>, 8> changed;
    SymbolModel<3> channel_step;
    ModelBank<16, 16> numbers_of_returns, return_numbers;
    SymbolModel<13> return_step;
    IntegerCodec<32, 2> x_code;
    IntegerCodec<32, 22> y_code;
  };

  static Value value_in(const std::byte* record) {
    const auto returns = std::to_integer<unsigned>(record[kReturns]);
    return {.x = load_little<std::uint32_t>(record),
            .y = load_little<std::uint32_t>(record + 4),
            .n = returns >> 4,
            .r = returns & 0x0F,
            .angle = load_little<std::uint16_t>(record + kAngle),
            .source = load_little<std::uint16_t>(record + kSource),
            .time = load_little<std::uint64_t>(record + kTime)};
  }

  /// What an encoder says of a point of the channel.
  [[nodiscard]] unsigned changes(const Value& actual, unsigned channel) {
    const unsigned now = channels_.number();
    const Value& last = channels_.knows(channel) ? channels_.of(channel).last : channels_.now().last;
    const unsigned step = (actual.r + 16 - last.r) % 16;
    const unsigned return_change = step <= 1 ? step : step == 15 ? 2 : kReturnChange;
    return (channel != now ? kChannelChanged : 0) | (actual.source != last.source ? kSourceChanged : 0) |
           (actual.time != last.time ? kTimeChanged : 0) | (actual.angle != last.angle ? kAngleChanged : 0) |
           (actual.n != last.n ? kNumberChanged : 0) | return_change;
  }

  /// All but x and y. Returns the state of the point's channel.
  template <class Coder>
  State& code_changes(Coder& coder, const Value& actual, unsigned channel, PointContext& context) {
    State* state = &channels_.now();
    const unsigned before =
        (state->last.r == 1 ? 1 : 0) + (state->last.r >= state->last.n ? 2 : 0) + (state->time_changed ? 4 : 0);
    const unsigned changed = coder.symbol(state->changed[before], Coder::kEncodes ? changes(actual, channel) : 0);
    context.channel_changed = (changed & kChannelChanged) != 0;
    if (context.channel_changed) {
      const unsigned step = coder.symbol(state->channel_step, (channel + 3 - channels_.number()) % 4) + 1;
      state = &channels_.go_to((channels_.number() + step) % 4);
    }
    context.channel = static_cast<std::uint8_t>(channels_.number());
    context.source_changed = (changed & kSourceChanged) != 0;
    context.time_changed = (changed & kTimeChanged) != 0;
    context.angle_changed = (changed & kAngleChanged) != 0;
    Value& last = state->last;
    if ((changed & kNumberChanged) != 0) last.n = coder.symbol(state->numbers_of_returns[last.n], actual.n);
    const unsigned return_change = changed & kReturnChange;
    if (return_change == 1) last.r = (last.r + 1) % 16;
    if (return_change == 2) last.r = (last.r + 15) % 16;
    if (return_change == kReturnChange) {
      last.r = context.time_changed
                   ? coder.symbol(state->return_numbers[last.r], actual.r)
                   : (last.r + coder.symbol(state->return_step, (actual.r + 14 - last.r) % 16) + 2) % 16;
    }
    return *state;
  }

  template <class Coder>
  static void code_place(Coder& coder, State& state, const Value& actual, PointContext& context) {
    Value& last = state.last;
    const unsigned steps = kReturnContext[last.n][last.r] * 2U + (context.time_changed ? 1 : 0);
    const unsigned single = last.n == 1 ? 1 : 0;
    const std::uint32_t x_step = state.x_code.code(coder, state.x_steps[steps].get(), single, actual.x - last.x);
    last.x += x_step;
    state.x_steps[steps].add(x_step);
    const unsigned x_magnitude = state.x_code.magnitude();
    const std::uint32_t y_step = state.y_code.code(coder, state.y_steps[steps].get(),
                                                   single + magnitude_context(x_magnitude, 20), actual.y - last.y);
    last.y += y_step;
    state.y_steps[steps].add(y_step);
    const unsigned magnitude = (x_magnitude + state.y_code.magnitude()) / 2;
    context.height_context = static_cast<std::uint8_t>(single + magnitude_context(magnitude, 18));
    context.level = static_cast<std::uint8_t>(return_level(last.n, last.r));
    context.place = static_cast<std::uint8_t>((last.r == 1 ? PointContext::kFirst : 0) +
                                              (last.r >= last.n ? PointContext::kLast : 0));
  }

  Channels<State> channels_;
  std::byte flags_;  ///< byte 15 of the first point without its channel
};

}  // namespace lamina::laz
