// Values as bytes in files: little-endian, as they lie in this machine's memory; and the other order, as some read.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>

namespace lamina {

static_assert(std::endian::native == std::endian::little, "files' values are copied as they lie in memory");

/// The T that stands at any address in little-endian order.
template <class T>
T load_little(const std::byte* from) {
  static_assert(std::is_trivially_copyable_v<T>);
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

/// The same in big-endian order.
template <class T>
T load_big(const std::byte* from) {
  std::array<std::byte, sizeof(T)> bytes;
  std::memcpy(bytes.data(), from, sizeof(T));
  std::reverse(bytes.begin(), bytes.end());  // compiles to one bswap
  return std::bit_cast<T>(bytes);
}

/// Writes the value in little-endian order; returns where it ends.
template <class T>
std::byte* store_little(std::byte* to, T value) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::memcpy(to, &value, sizeof value);
  return to + sizeof value;
}

/// Appends the value in little-endian order.
template <class T>
void append_little(std::string& bytes, T value) {
  static_assert(std::is_trivially_copyable_v<T>);
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace lamina
