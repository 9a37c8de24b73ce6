#include "points/ply_columns.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

namespace lamina {
namespace {

template <std::size_t kBytes>
auto swap_bytes(std::array<std::byte, kBytes> bytes) {
  std::reverse(bytes.begin(), bytes.end());  // compiles to one bswap
  return bytes;
}

/// Loads a T from any address.
template <class T, bool kSwapped>
struct Load {
  T operator()(const std::byte* from) const {
    std::array<std::byte, sizeof(T)> bytes;
    std::memcpy(bytes.data(), from, sizeof(T));
    if constexpr (kSwapped) bytes = swap_bytes(bytes);
    return std::bit_cast<T>(bytes);
  }
};

/// Calls `use` with a loader of the stored type.
template <bool kSwapped, class Use>
auto with_type(ScalarType type, Use use) {
  switch (type) {
    case ScalarType::int8:
      return use(Load<std::int8_t, kSwapped>{});
    case ScalarType::uint8:
      return use(Load<std::uint8_t, kSwapped>{});
    case ScalarType::int16:
      return use(Load<std::int16_t, kSwapped>{});
    case ScalarType::uint16:
      return use(Load<std::uint16_t, kSwapped>{});
    case ScalarType::int32:
      return use(Load<std::int32_t, kSwapped>{});
    case ScalarType::uint32:
      return use(Load<std::uint32_t, kSwapped>{});
    case ScalarType::float32:
      return use(Load<float, kSwapped>{});
    case ScalarType::float64:
      break;
  }
  return use(Load<double, kSwapped>{});
}

}  // namespace

template <class Out>
void convert_column(ScalarType type, bool swapped, const std::byte* row, std::size_t stride, std::size_t count,
                    Out* out) {
  const auto loop = [=](auto load_value) {
    const std::byte* from = row;
    for (std::size_t i = 0; i < count; ++i, from += stride) out[i] = static_cast<Out>(load_value(from));
  };
  swapped ? with_type<true>(type, loop) : with_type<false>(type, loop);
}

template void convert_column(ScalarType, bool, const std::byte*, std::size_t, std::size_t, float*);
template void convert_column(ScalarType, bool, const std::byte*, std::size_t, std::size_t, double*);

long long read_integer(ScalarType type, bool swapped, const std::byte* bytes) {
  const auto value = [=](auto load_value) { return static_cast<long long>(load_value(bytes)); };
  return swapped ? with_type<true>(type, value) : with_type<false>(type, value);
}

}  // namespace lamina
