// Adaptive models of the arithmetic coder of LAZ (Amir Said, "Introduction to Arithmetic Coding", HP Labs 2004): how
// often each symbol came so far. Encoder and decoder update them alike.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

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

}  // namespace lamina::laz
