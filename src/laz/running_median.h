// The predictor of coordinates in LAZ: of about the last five differences the one in the middle.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>

namespace lamina::laz {

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
