// The arithmetic coder of LAZ (Amir Said, "Introduction to Arithmetic Coding", HP Labs 2004): adaptive models, which
// say how often each symbol came so far, a decoder and an encoder, which update them alike.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

namespace lamina::laz {

/// Probabilities are in units of 1 / 2^kSymbolBits, those of bits in 1 / 2^kBitBits.
inline constexpr unsigned kSymbolBits = 15;
inline constexpr unsigned kBitBits = 13;

/// One of two symbols.
class BitModel {
 public:
  [[nodiscard]] std::uint32_t zero() const { return zero_; }  ///< probability of 0
  void count(unsigned bit) {
    zeros_ += 1 - bit;
    if (--left_ == 0) update();
  }

 private:
  void update() {
    constexpr std::uint32_t kMostCounted = 1U << kBitBits;
    constexpr std::uint32_t kLongestCycle = 64;
    if ((bits_ += cycle_) > kMostCounted) {
      bits_ = (bits_ + 1) / 2;
      zeros_ = (zeros_ + 1) / 2;
      if (zeros_ == bits_) ++bits_;
    }
    zero_ = (zeros_ * (0x80000000U / bits_)) >> (31 - kBitBits);
    left_ = cycle_ = std::min(5 * cycle_ / 4, kLongestCycle);
  }

  std::uint32_t zero_ = 1U << (kBitBits - 1), zeros_ = 1, bits_ = 2, cycle_ = 4, left_ = 4;
};

/// One of up to kMost symbols.
template <unsigned kMost>
class SymbolModel {
 public:
  explicit SymbolModel(unsigned symbols = kMost) : symbols_(symbols), total_(symbols) {
    counts_.fill(1);
    // Places of the table are about half as long as the probability of a symbol of the even distribution.
    shift_ = kSymbolBits - std::min(kTableBits, static_cast<unsigned>(std::bit_width(symbols)));
    spread();
    left_ = cycle_ = (symbols + 6) / 2;
  }

  /// The symbol whose share of 2^kSymbolBits holds `place`, which may be a little beyond the end.
  [[nodiscard]] unsigned at(std::uint32_t place) const {
    unsigned symbol = table_[place >> shift_];
    while (starts_[symbol + 1] <= place) ++symbol;
    return symbol;
  }
  [[nodiscard]] bool is_last(unsigned symbol) const { return symbol + 1 == symbols_; }
  /// Where a symbol's share begins.
  [[nodiscard]] std::uint32_t start(unsigned symbol) const { return starts_[symbol]; }

  void count(unsigned symbol) {
    ++counts_[symbol];
    if (--left_ == 0) update();
  }

 private:
  using Symbol = std::conditional_t<(kMost > 256), std::uint16_t, std::uint8_t>;
  static constexpr unsigned kTableBits = std::min(9U, static_cast<unsigned>(std::bit_width(kMost)));
  static constexpr std::uint16_t kEnd = 0xFFFF;  ///< beyond every place

  [[gnu::noinline]] void update() {
    constexpr std::uint32_t kMostCounted = 1U << kSymbolBits;
    if ((total_ += cycle_) > kMostCounted) {
      total_ = 0;
      for (unsigned k = 0; k < symbols_; ++k) {
        counts_[k] = static_cast<std::uint16_t>((counts_[k] + 1) / 2);
        total_ += counts_[k];
      }
    }
    spread();
    left_ = cycle_ = std::min(5 * cycle_ / 4, (symbols_ + 6) * 8);
  }

  /// Shares by the counts, and the table that finds them.
  void spread() {
    const std::uint32_t scale = 0x80000000U / total_;
    std::uint32_t sum = 0;
    for (unsigned k = 0; k < symbols_; ++k) {
      starts_[k] = static_cast<std::uint16_t>((scale * sum) >> (31 - kSymbolBits));
      sum += counts_[k];
    }
    starts_[symbols_] = kEnd;
    const unsigned places = 1U << (kSymbolBits - shift_);
    unsigned symbol = 0;
    for (unsigned t = 0; t <= places; ++t) {
      while (starts_[symbol + 1] <= t << shift_) ++symbol;
      table_[t] = static_cast<Symbol>(symbol);
    }
  }

  std::uint32_t symbols_, total_, cycle_ = 0, left_ = 0, shift_ = 0;
  std::array<std::uint16_t, kMost + 1> starts_{};
  std::array<std::uint16_t, kMost> counts_{};
  std::array<Symbol, (1U << kTableBits) + 1> table_{};
};

// Models by context, made when a context comes up: most of them never do.

template <unsigned kSymbols, unsigned kContexts>
class ModelBank {
 public:
  SymbolModel<kSymbols>& operator[](unsigned context) {
    std::unique_ptr<SymbolModel<kSymbols>>& model = models_[context];
    if (model == nullptr) model = std::make_unique<SymbolModel<kSymbols>>();
    return *model;
  }

 private:
  std::array<std::unique_ptr<SymbolModel<kSymbols>>, kContexts> models_;
};

// The decoder: symbols and bits out of a run of bytes.

/// What is wrong with compressed bytes, without file and place.
struct Damaged : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Interval [0, length) of 32 bits and a value in it. Throws Damaged when the bytes end too early. Decode through a
/// copy on the stack: the compiler keeps it in registers.
class ArithmeticDecoder {
 public:
  static constexpr bool kEncodes = false;

  ArithmeticDecoder() = default;
  /// Throws Damaged also for a beginning that no encoder writes.
  explicit ArithmeticDecoder(std::span<const std::byte> code) : next_(code.data()), end_(next_ + code.size()) {
    for (int i = 0; i < 4; ++i) value_ = value_ << 8 | byte();
    if (value_ == length_) throw Damaged("the compressed bytes begin like none");
  }

  template <unsigned kMost>
  unsigned symbol(SymbolModel<kMost>& model, unsigned = 0) {
    const std::uint32_t unit = length_ >> kSymbolBits;
    const unsigned symbol = model.at(value_ / unit);
    const std::uint32_t low = model.start(symbol) * unit;
    const std::uint32_t high = model.is_last(symbol) ? length_ : model.start(symbol + 1) * unit;
    value_ -= low;
    length_ = high - low;
    model.count(symbol);
    renormalise();
    return symbol;
  }

  unsigned bit(BitModel& model, unsigned = 0) {
    const std::uint32_t split = model.zero() * (length_ >> kBitBits);
    const unsigned bit = value_ >= split ? 1 : 0;
    value_ -= bit != 0 ? split : 0;
    length_ = bit != 0 ? length_ - split : split;
    model.count(bit);
    renormalise();
    return bit;
  }

  /// 1 to 32 bits, all values alike.
  std::uint32_t bits(unsigned count, std::uint32_t = 0) {
    constexpr unsigned kAtOnce = 19;
    constexpr unsigned kLow = 16;
    if (count <= kAtOnce) return few_bits(count);
    const std::uint32_t low = few_bits(kLow);
    return low | few_bits(count - kLow) << kLow;
  }

  /// Bytes that are left; an encoder writes as many as its decoder takes.
  [[nodiscard]] std::size_t left() const { return static_cast<std::size_t>(end_ - next_); }

 private:
  static constexpr std::uint32_t kShortest = 1U << 24;

  std::uint32_t few_bits(unsigned count) {
    length_ >>= count;
    const std::uint32_t value = value_ / length_;
    if (value >> count != 0) throw Damaged("it holds a number that is too large");
    value_ -= value * length_;
    renormalise();
    return value;
  }
  void renormalise() {
    while (length_ < kShortest) {
      value_ = value_ << 8 | byte();
      length_ <<= 8;
    }
  }
  std::uint32_t byte() {
    if (next_ == end_) throw Damaged("the compressed bytes end too early");
    return std::to_integer<std::uint32_t>(*next_++);
  }

  const std::byte* next_ = nullptr;
  const std::byte* end_ = nullptr;
  std::uint32_t value_ = 0, length_ = 0xFFFFFFFF;
};

// The encoder, the other way of the decoder: it has the same calls, which take what those give.

class ArithmeticEncoder {
 public:
  static constexpr bool kEncodes = true;

  template <unsigned kMost>
  unsigned symbol(SymbolModel<kMost>& model, unsigned symbol) {
    const std::uint32_t unit = length_ >> kSymbolBits;
    const std::uint32_t low = model.start(symbol) * unit;
    length_ = (model.is_last(symbol) ? length_ : model.start(symbol + 1) * unit) - low;
    advance(low);
    model.count(symbol);
    renormalise();
    return symbol;
  }

  unsigned bit(BitModel& model, unsigned bit) {
    const std::uint32_t split = model.zero() * (length_ >> kBitBits);
    advance(bit != 0 ? split : 0);
    length_ = bit != 0 ? length_ - split : split;
    model.count(bit);
    renormalise();
    return bit;
  }

  /// 1 to 32 bits, all values alike.
  std::uint32_t bits(unsigned count, std::uint32_t value) {
    constexpr unsigned kAtOnce = 19;
    constexpr unsigned kLow = 16;
    if (count <= kAtOnce) {
      few_bits(count, value);
    } else {
      few_bits(kLow, value & ((1U << kLow) - 1));
      few_bits(count - kLow, value >> kLow);
    }
    return value;
  }

  /// All bytes; nothing can be added. Zeros at the end are those that a decoder reads ahead.
  std::vector<std::byte> finish() {
    const bool is_long = length_ > 2 * kShortest;
    advance(is_long ? kShortest : kShortest / 2);
    length_ = is_long ? kShortest / 2 : kShortest >> 9;
    renormalise();
    bytes_.insert(bytes_.end(), is_long ? 3 : 2, std::byte{});
    return std::move(bytes_);
  }

 private:
  static constexpr std::uint32_t kShortest = 1U << 24;

  void few_bits(unsigned count, std::uint32_t value) {
    length_ >>= count;
    advance(value * length_);
    renormalise();
  }
  void advance(std::uint32_t by) {
    base_ += by;
    if (base_ >= by) return;
    // Carries into the bytes that are out: there is one below 255, as all of them together are a fraction below 1.
    std::size_t at = bytes_.size() - 1;
    for (; bytes_[at] == std::byte{0xFF}; --at) bytes_[at] = std::byte{};
    bytes_[at] = static_cast<std::byte>(std::to_integer<unsigned>(bytes_[at]) + 1);
  }
  void renormalise() {
    while (length_ < kShortest) {
      bytes_.push_back(static_cast<std::byte>(base_ >> 24));
      base_ <<= 8;
      length_ <<= 8;
    }
  }

  std::vector<std::byte> bytes_;
  std::uint32_t base_ = 0, length_ = 0xFFFFFFFF;
};

}  // namespace lamina::laz
