// Independent draws for a sample's further tries.
#pragma once
#include <cstdint>

namespace lamina::scatter_detail {

inline std::uint64_t attempt_seed(std::uint64_t seed, std::uint32_t attempt) {
  return seed + attempt * 0xD1B54A32D192ED03ull;
}

}  // namespace lamina::scatter_detail
