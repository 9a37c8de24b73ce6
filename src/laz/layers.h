// The layers of LAS 1.4's points. Every value is predicted from the last point of the same scanner channel; a channel
// that comes up begins with what the point before had. One code for both ways, as field_codecs.h: an encoder finds the
// values in the records, a decoder puts them there.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "base/number.h"
#include "laz/arithmetic_coder.h"
#include "laz/field_codecs.h"

namespace lamina::laz {

/// What the layer of coordinates tells the others of a point.
struct PointContext {
  static constexpr std::uint8_t kSingle = 3, kFirst = 2, kLast = 1;

  std::uint8_t channel = 0;      ///< of the scanner, 0 to 3
  bool channel_changed = false;  ///< from the point before
  bool time_changed = false;     ///< these three from the last point of the channel
  bool angle_changed = false;
  bool source_changed = false;
  std::uint8_t place = 0;  ///< among the returns of its pulse: kSingle, kFirst, kLast, or 0 between these
  std::uint8_t level = 0;  ///< return_level()
  std::uint8_t height_context = 0;
};

/// What a layer keeps for each channel, made when it comes up. State(v) begins with the value v, state.value() is its
/// last.
template <class State>
class Channels {
 public:
  using Value = decltype(std::declval<const State&>().value());

  Channels(unsigned first, const Value& value) : now_(first) { states_[first] = std::make_unique<State>(value); }

  [[nodiscard]] State& now() { return *states_[now_]; }
  [[nodiscard]] unsigned number() const { return now_; }
  /// Of a channel that has come up before.
  [[nodiscard]] const State& of(unsigned channel) const { return *states_[channel]; }
  /// Whether the channel has come up before.
  [[nodiscard]] bool knows(unsigned channel) const { return states_[channel] != nullptr; }
  /// The state of `channel`, which becomes the present one.
  State& go_to(unsigned channel) {
    if (channel != now_) {
      if (!knows(channel)) states_[channel] = std::make_unique<State>(now().value());
      now_ = channel;
    }
    return now();
  }

 private:
  std::array<std::unique_ptr<State>, 4> states_;
  unsigned now_;
};

/// The scanner's channel in a record.
inline unsigned channel_in(const std::byte* record) {
  return std::to_integer<unsigned>(record[15]) >> 4 & 3;
}

/// A layer of one value a point, which State codes.
template <class State>
class ValueLayer {
 public:
  explicit ValueLayer(const std::byte* first) : channels_(channel_in(first), State::value_in(first)) {}

  template <class Coder>
  void code(Coder& coder, const PointContext* contexts, std::size_t count, std::byte* records, std::size_t stride) {
    for (std::size_t i = 0; i < count; ++i, records += stride) {
      channels_.go_to(contexts[i].channel).code(coder, contexts[i], records);
    }
  }

 private:
  Channels<State> channels_;
};

/// What the state of a layer knows of its value, a T at that place of the record.
template <class T, std::size_t kPlace>
class FieldState {
 public:
  explicit FieldState(T value) : last_(value) {}
  static T value_in(const std::byte* record) { return load_little<T>(record + kPlace); }
  [[nodiscard]] T value() const { return last_; }

 protected:
  void put(std::byte* record) const { store_little(record + kPlace, last_); }
  T last_;
};

class HeightState : public FieldState<std::uint32_t, 8> {
 public:
  explicit HeightState(std::uint32_t z) : FieldState(z) { by_level_.fill(z); }
  template <class Coder>
  void code(Coder& coder, const PointContext& c, std::byte* record) {
    last_ = by_level_[c.level] = code_.code(coder, by_level_[c.level], c.height_context, value_in(record));
    put(record);
  }

 private:
  std::array<std::uint32_t, 8> by_level_{};
  IntegerCodec<32, 20> code_;
};

class ClassState : public FieldState<std::uint8_t, 16> {
 public:
  using FieldState::FieldState;
  template <class Coder>
  void code(Coder& coder, const PointContext& c, std::byte* record) {
    last_ = static_cast<std::uint8_t>(
        coder.symbol(models_[(last_ & 0x1FU) * 2 + (c.place == PointContext::kSingle ? 1 : 0)], value_in(record)));
    put(record);
  }

 private:
  ModelBank<256, 64> models_;
};

/// Four flags of the class, scan direction and edge of the flight line; the channel stands between them.
class FlagsState {
 public:
  explicit FlagsState(unsigned value) : last_(value) {}
  static unsigned value_in(const std::byte* record) {
    const auto flags = std::to_integer<unsigned>(record[kPlace]);
    return (flags & 0x0F) | (flags >> 2 & 0x30);
  }
  [[nodiscard]] unsigned value() const { return last_; }
  template <class Coder>
  void code(Coder& coder, const PointContext& c, std::byte* record) {
    last_ = coder.symbol(models_[last_], value_in(record));
    record[kPlace] = static_cast<std::byte>((last_ & 0x0F) | (last_ & 0x30) << 2 | c.channel << 4);
  }

 private:
  static constexpr std::size_t kPlace = 15;
  unsigned last_;
  ModelBank<64, 64> models_;
};

class IntensityState : public FieldState<std::uint16_t, 12> {
 public:
  explicit IntensityState(std::uint16_t value) : FieldState(value) { by_place_.fill(value); }
  template <class Coder>
  void code(Coder& coder, const PointContext& c, std::byte* record) {
    std::uint16_t& at_place = by_place_[c.place * 2U + (c.time_changed ? 1 : 0)];
    last_ = at_place = static_cast<std::uint16_t>(code_.code(coder, at_place, c.place, value_in(record)));
    put(record);
  }

 private:
  std::array<std::uint16_t, 8> by_place_{};
  IntegerCodec<16, 4> code_;
};

class AngleState : public FieldState<std::uint16_t, 18> {
 public:
  using FieldState::FieldState;
  template <class Coder>
  void code(Coder& coder, const PointContext& c, std::byte* record) {
    if (c.angle_changed) {
      last_ = static_cast<std::uint16_t>(code_.code(coder, last_, c.time_changed ? 1 : 0, value_in(record)));
    }
    put(record);
  }

 private:
  IntegerCodec<16, 2> code_;
};

class UserState : public FieldState<std::uint8_t, 17> {
 public:
  using FieldState::FieldState;
  template <class Coder>
  void code(Coder& coder, const PointContext&, std::byte* record) {
    last_ = static_cast<std::uint8_t>(coder.symbol(models_[last_ / 4U], value_in(record)));
    put(record);
  }

 private:
  ModelBank<256, 64> models_;
};

class SourceState : public FieldState<std::uint16_t, 20> {
 public:
  using FieldState::FieldState;
  template <class Coder>
  void code(Coder& coder, const PointContext& c, std::byte* record) {
    if (c.source_changed) last_ = static_cast<std::uint16_t>(code_.code(coder, last_, 0, value_in(record)));
    put(record);
  }

 private:
  IntegerCodec<16, 1> code_;
};

class TimeState : public FieldState<std::uint64_t, 22> {
 public:
  explicit TimeState(std::uint64_t value) : FieldState(value), code_(value) {}
  template <class Coder>
  void code(Coder& coder, const PointContext& c, std::byte* record) {
    if (c.time_changed) last_ = code_.code(coder, value_in(record));
    put(record);
  }

 private:
  GpsTimeCodec<false> code_;
};

/// Values at a place that depends on the format. With channels apart (RecordLayout::channels_apart) as the other
/// layers; else as encoders did before: all points are channel 0's but those where the channel changes, and a channel
/// that comes up again takes the last value of the channel before, and gives it the new one.
template <class Codec, class T>
class PlacedLayer {
 public:
  PlacedLayer(const std::byte* first, std::size_t place, bool channels_apart)
      : channels_(channel_in(first), load_little<T>(first + place)), place_(place), channels_apart_(channels_apart) {}

  template <class Coder>
  void code(Coder& coder, const PointContext* contexts, std::size_t count, std::byte* records, std::size_t stride) {
    records += place_;
    for (std::size_t i = 0; i < count; ++i, records += stride) {
      const PointContext& c = contexts[i];
      const unsigned channel = channels_apart_ || c.channel_changed ? c.channel : 0U;
      T& before = channels_.now().last;
      const bool takes_before = !channels_apart_ && channels_.knows(channel);
      State& state = channels_.go_to(channel);
      T& last = takes_before ? before : state.last;
      last = state.codec.code(coder, last, load_little<T>(records));
      store_little(records, last);
    }
  }

 private:
  struct State {
    explicit State(const T& value) : last(value) {}
    [[nodiscard]] const T& value() const { return last; }
    T last;
    Codec codec;
  };

  Channels<State> channels_;
  std::size_t place_;
  bool channels_apart_;
};

using HeightLayer = ValueLayer<HeightState>;
using ClassLayer = ValueLayer<ClassState>;
using FlagsLayer = ValueLayer<FlagsState>;
using IntensityLayer = ValueLayer<IntensityState>;
using AngleLayer = ValueLayer<AngleState>;
using UserLayer = ValueLayer<UserState>;
using SourceLayer = ValueLayer<SourceState>;
using TimeLayer = ValueLayer<TimeState>;
using ColourLayer = PlacedLayer<ColourCodec, Colour>;
using InfraredLayer = PlacedLayer<InfraredCodec, std::uint16_t>;
using ExtraByteLayer = PlacedLayer<ExtraByteCodec, std::uint8_t>;

}  // namespace lamina::laz
