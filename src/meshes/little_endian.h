// Values to little-endian bytes.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <string>

namespace lamina::meshes {

template <class T>
void put_little(std::string& bytes, T value) {
  auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if constexpr (std::endian::native == std::endian::big) std::reverse(raw.begin(), raw.end());
  bytes.append(raw.data(), raw.size());
}

}  // namespace lamina::meshes
