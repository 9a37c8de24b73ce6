// Selection where chance decides how values compare.
#pragma once
#include <algorithm>
#include <cstddef>
#include <span>

namespace lamina {

/// Brings those of which goes(value) is true to the front, without a branch for any; returns how many there are.
template <typename T, typename Goes>
std::size_t bring_to_front(std::span<T> values, const Goes& goes) {
  std::size_t front = 0;
  for (T& value : values) {
    const T moved = value;
    value = values[front];
    values[front] = moved;
    front += static_cast<std::size_t>(goes(moved));
  }
  return front;
}

/// The value that sorting would put at `nth`. Changes their order. Of values that are as good as random
/// std::nth_element guesses every second branch wrong.
template <typename T>
T nth_value(std::span<T> values, std::size_t nth) {
  constexpr std::size_t kFew = 24;
  constexpr int kMostRounds = 64;  // far more than any but made-up values take
  for (int round = 0; values.size() > kFew && round < kMostRounds; ++round) {
    const T a = values.front(), b = values[values.size() / 2], c = values.back();
    const T pivot = std::max(std::min(a, b), std::min(std::max(a, b), c));
    std::size_t front = bring_to_front(values, [pivot](T value) { return value < pivot; });
    if (front == 0) {  // none is less
      front = bring_to_front(values, [pivot](T value) { return !(pivot < value); });
      if (nth < front) return pivot;
    }
    if (nth < front) {
      values = values.first(front);
    } else {
      values = values.subspan(front);
      nth -= front;
    }
  }
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(nth);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

}  // namespace lamina
