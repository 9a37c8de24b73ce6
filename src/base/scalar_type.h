// The scalar types of attributes: as types of the language, with what they can hold, and by their names in PLY headers.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <type_traits>

#include "lamina/attributes.h"

namespace lamina {

/// Calls use(zero of the type).
template <class Use>
auto with_scalar_type(ScalarType type, const Use& use) {
  switch (type) {
    case ScalarType::int8:
      return use(std::int8_t{});
    case ScalarType::uint8:
      return use(std::uint8_t{});
    case ScalarType::int16:
      return use(std::int16_t{});
    case ScalarType::uint16:
      return use(std::uint16_t{});
    case ScalarType::int32:
      return use(std::int32_t{});
    case ScalarType::uint32:
      return use(std::uint32_t{});
    case ScalarType::float32:
      return use(float{});
    case ScalarType::float64:
      break;
  }
  return use(double{});
}

/// The value as a T; for integers rounded to the nearest (ties to even) and clamped.
template <class T, class Value>
T to_scalar(Value value) {
  if constexpr (std::is_floating_point_v<T>) {
    return static_cast<T>(value);
  } else {
    constexpr double kLow = std::numeric_limits<T>::min();
    constexpr double kHigh = std::numeric_limits<T>::max();
    return static_cast<T>(std::llrint(std::clamp(static_cast<double>(value), kLow, kHigh)));
  }
}

inline bool is_integer_type(ScalarType type) {
  return type != ScalarType::float32 && type != ScalarType::float64;
}

/// The value of the type that stands at any address, little-endian or `swapped`; a double holds any.
double load_scalar(ScalarType type, bool swapped, const std::byte* from);

/// The least and greatest value of an integer type; floats have no bounds.
struct ScalarRange {
  double low, high;
};
ScalarRange scalar_range(ScalarType type);

/// The classic name: char uchar short ushort int uint float double.
std::string_view ply_name(ScalarType type);

/// Both families of names: the classic ones and int8 ... float64.
std::optional<ScalarType> ply_type(std::string_view name);

}  // namespace lamina
