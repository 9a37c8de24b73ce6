// The first layer: where every point lies, which return of its pulse it is, and what else is new about it.
#include <cstddef>
#include <cstdint>

#include "base/little_endian.h"
#include "laz/layer_decoders.h"

namespace lamina::laz {
namespace {

constexpr std::size_t kReturns = 14, kFlags = 15;
constexpr std::byte kChannel{0x30};

/// Bits of the symbol that tells what changed.
constexpr unsigned kChannelChanged = 1 << 6, kSourceChanged = 1 << 5, kTimeChanged = 1 << 4, kAngleChanged = 1 << 3,
                   kNumberChanged = 1 << 2, kReturnChange = 3;

}  // namespace

CoreLayer::CoreLayer(const std::byte* first)
    : channels_(channel_in(first), value_in(first)), flags_(first[kFlags] & ~kChannel) {}

CoreLayer::Value CoreLayer::value_in(const std::byte* record) {
  const auto returns = std::to_integer<unsigned>(record[kReturns]);
  return {load_little<std::uint32_t>(record), load_little<std::uint32_t>(record + 4), returns >> 4, returns & 0x0F};
}

unsigned CoreLayer::return_number(ArithmeticDecoder& code, State& state, unsigned change, bool time_changed) {
  const unsigned last = state.last.r;
  if (change == 0) return last;
  if (change == 1) return (last + 1) % 16;
  if (change == 2) return (last + 15) % 16;
  if (time_changed) return code.symbol(state.return_numbers[last]);
  return (last + code.symbol(state.return_step) + 2) % 16;
}

void CoreLayer::decode_place(ArithmeticDecoder& code, State& state, PointContext& context) {
  const auto [n, r] = std::pair(state.last.n, state.last.r);
  const unsigned steps = kReturnContext[n][r] * 2U + (context.time_changed ? 1 : 0);
  const unsigned single = n == 1 ? 1 : 0;
  const std::uint32_t x_step = state.x_code.code(code, state.x_steps[steps].get(), single);
  state.last.x += x_step;
  state.x_steps[steps].add(x_step);
  const unsigned x_magnitude = state.x_code.magnitude();
  const std::uint32_t y_step =
      state.y_code.code(code, state.y_steps[steps].get(), single + magnitude_context(x_magnitude, 20));
  state.last.y += y_step;
  state.y_steps[steps].add(y_step);
  const unsigned magnitude = (x_magnitude + state.y_code.magnitude()) / 2;
  context.height_context = static_cast<std::uint8_t>(single + magnitude_context(magnitude, 18));
  context.level = static_cast<std::uint8_t>(return_level(n, r));
  context.place = static_cast<std::uint8_t>((r == 1 ? PointContext::kFirst : 0) + (r >= n ? PointContext::kLast : 0));
}

void CoreLayer::decode(ArithmeticDecoder& code, std::size_t count, PointContext* contexts, std::byte* to,
                       std::size_t stride) {
  for (std::size_t i = 0; i < count; ++i, to += stride) {
    State* state = &channels_.now();
    const unsigned before =
        (state->last.r == 1 ? 1 : 0) + (state->last.r >= state->last.n ? 2 : 0) + (state->time_changed ? 4 : 0);
    const unsigned changed = code.symbol(state->changed[before]);
    PointContext& context = contexts[i];
    context.channel_changed = (changed & kChannelChanged) != 0;
    if (context.channel_changed) {
      const unsigned step = code.symbol(state->channel_step) + 1;
      state = &channels_.go_to((channels_.number() + step) % 4);
    }
    context.channel = static_cast<std::uint8_t>(channels_.number());
    context.source_changed = (changed & kSourceChanged) != 0;
    context.time_changed = (changed & kTimeChanged) != 0;
    context.angle_changed = (changed & kAngleChanged) != 0;
    if ((changed & kNumberChanged) != 0) state->last.n = code.symbol(state->numbers_of_returns[state->last.n]);
    state->last.r = return_number(code, *state, changed & kReturnChange, context.time_changed);
    decode_place(code, *state, context);
    state->time_changed = context.time_changed;
    store_little(to, state->last.x);
    store_little(to + 4, state->last.y);
    to[kReturns] = static_cast<std::byte>(state->last.n << 4 | state->last.r);
    to[kFlags] = flags_ | static_cast<std::byte>(context.channel << 4);
  }
}

}  // namespace lamina::laz
