// Values to little-endian bytes and back.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>

namespace lamina {

/// Appends the value in little-endian order.
template <class T>
void put_little(std::string& bytes, T value) {
  auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if constexpr (std::endian::native == std::endian::big) std::reverse(raw.begin(), raw.end());
  bytes.append(raw.data(), raw.size());
}

/// The T at `bytes`, which stands there in little-endian order.
template <class T>
T load_little(const std::byte* bytes) {
  static_assert(std::endian::native == std::endian::little && std::is_trivially_copyable_v<T>);
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

}  // namespace lamina
