// What the coders of LAZ look at: the return of a point, and the differences of coordinates before it.
//
// Which models are taken for a point goes by its number of returns n and its return number r, from 0 as some files have
// them.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

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

}  // namespace lamina::laz
