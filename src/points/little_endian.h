// Numbers in the headers of little-endian formats.
#pragma once
#include <bit>
#include <cstddef>
#include <cstring>
#include <type_traits>

namespace lamina {

/// The T at `bytes`, which stands there in little-endian order.
template <class T>
T load_little(const std::byte* bytes) {
  static_assert(std::endian::native == std::endian::little && std::is_trivially_copyable_v<T>);
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

}  // namespace lamina
