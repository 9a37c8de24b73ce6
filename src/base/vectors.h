// What is asked of vectors of numbers in many places.
#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

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

/// The value that a share of all (0..1) lies below, at 0.5 the median; 0 of none. Changes their order.
template <typename T>
T quantile_of(std::vector<T>& values, double share) {
  if (values.empty()) return T{};
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size()));
  const auto value = values.begin() + std::min(place, static_cast<std::ptrdiff_t>(values.size()) - 1);
  std::nth_element(values.begin(), value, values.end());
  return *value;
}

template <typename T>
T median_of(std::vector<T>& values) {
  return quantile_of(values, 0.5);
}

}  // namespace lamina
