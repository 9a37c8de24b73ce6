// What is asked of vectors of numbers in many places.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/nth_value.h"

namespace lamina {

/// Sizes a vector whose contents are about to be written anew (they are unspecified afterwards), as for slabs of ever
/// other sizes. Grows by a sixteenth at most and copies nothing, where resize() doubles and copies.
template <typename T>
void resize_anew(std::vector<T>& values, std::size_t size) {
  if (size > values.capacity()) {
    values = {};
    values.reserve(size + size / 16);
  }
  values.resize(size);
}

/// The least and the greatest of some. std::minmax_element(), which tells their places too, goes on by branches that
/// are as good as random.
template <typename T>
std::pair<T, T> least_and_greatest(const std::vector<T>& values) {
  T least = values.front();
  T greatest = least;
  for (const T& v : values) {
    least = std::min(least, v);
    greatest = std::max(greatest, v);
  }
  return {least, greatest};
}

/// The value that a share of all (0..1) lies below, at 0.5 the median; 0 of none. Changes their order.
template <typename T>
T quantile_of(std::vector<T>& values, double share) {
  if (values.empty()) return T{};
  const auto place = static_cast<std::size_t>(share * static_cast<double>(values.size()));
  return nth_value(std::span<T>(values), std::min(place, values.size() - 1));
}

template <typename T>
T median_of(std::vector<T>& values) {
  return quantile_of(values, 0.5);
}

/// A stable sort by small integers: by key(item), at most `largest`, in one pass per eleven bits of it. `scratch` is
/// storage kept between calls.
template <class T, class Key>
void digit_sort(std::vector<T>& items, std::vector<T>& scratch, std::uint64_t largest, const Key& key) {
  constexpr int kBits = 11;
  constexpr std::size_t kDigits = std::size_t{1} << kBits;
  scratch.resize(items.size());
  for (int shift = 0; shift < 64 && (largest >> shift) != 0; shift += kBits) {
    const auto digit = [&](const T& item) { return static_cast<std::size_t>(key(item) >> shift) & (kDigits - 1); };
    std::array<std::uint32_t, kDigits> begin{};
    for (const T& item : items) ++begin[digit(item)];
    std::uint32_t sum = 0;
    for (std::uint32_t& b : begin) sum += std::exchange(b, sum);
    for (const T& item : items) scratch[begin[digit(item)]++] = item;
    items.swap(scratch);
  }
}

}  // namespace lamina
