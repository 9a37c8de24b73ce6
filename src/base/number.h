// Numbers: the types of attributes, values as bytes in files, and numbers in text.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
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

// Values as bytes in files: little-endian, as they lie in this machine's memory; and the other order, as some read.

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

// Numbers in text files.

/// Blanks within a line.
inline bool is_space(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

/// Without blanks at either end.
std::string_view trimmed(std::string_view text);

/// Parses a number at the beginning of [p, end) as double; returns where it ends, null when there is none.
/// Too large becomes infinite, too small zero, as a wider type shows; nan and inf are numbers.
const char* parse_decimal(const char* p, const char* end, double& value);

/// The same, with what only some programs write: 1.#QNAN, -1.#IND and 1.#INF of Microsoft's libraries, and 1.5D+02, as
/// Fortran writes doubles.
const char* parse_number(const char* p, const char* end, double& value);

/// Whether all of the word is a number, as parse_number() reads it, which is then its `value`.
bool is_number(std::string_view word, double& value);
bool is_number(std::string_view word);

/// The decimal number `text` begins with behind blanks; `text` moves behind it.
std::optional<double> take_decimal(std::string_view& text);

/// The whole number of 64 bits, digits only, that is all of the word.
std::optional<std::uint64_t> parse_whole(std::string_view word);

}  // namespace lamina
