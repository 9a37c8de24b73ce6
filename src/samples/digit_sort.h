// A stable sort by small integers: samples by the place they lie in.
#pragma once
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace lamina {

/// Sorts by key(item), at most `largest`, in one pass per eleven bits of it. `scratch` is storage kept between calls.
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
