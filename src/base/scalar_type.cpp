#include "base/scalar_type.h"

#include <array>

#include "base/little_endian.h"

namespace lamina {
namespace {

struct Names {
  ScalarType type;
  std::string_view classic, sized;
};

/// In the order of ScalarType.
constexpr std::array<Names, 8> kNames{{{ScalarType::int8, "char", "int8"},
                                       {ScalarType::uint8, "uchar", "uint8"},
                                       {ScalarType::int16, "short", "int16"},
                                       {ScalarType::uint16, "ushort", "uint16"},
                                       {ScalarType::int32, "int", "int32"},
                                       {ScalarType::uint32, "uint", "uint32"},
                                       {ScalarType::float32, "float", "float32"},
                                       {ScalarType::float64, "double", "float64"}}};

}  // namespace

double load_scalar(ScalarType type, bool swapped, const std::byte* from) {
  return with_scalar_type(type, [=](auto zero) {
    using T = decltype(zero);
    return static_cast<double>(swapped ? load_big<T>(from) : load_little<T>(from));
  });
}

ScalarRange scalar_range(ScalarType type) {
  return with_scalar_type(type, [](auto zero) -> ScalarRange {
    using T = decltype(zero);
    constexpr bool kFloat = std::is_floating_point_v<T>;
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    return {kFloat ? -kInfinity : static_cast<double>(std::numeric_limits<T>::min()),
            kFloat ? kInfinity : static_cast<double>(std::numeric_limits<T>::max())};
  });
}

std::string_view ply_name(ScalarType type) {
  return kNames.at(static_cast<std::size_t>(type)).classic;
}

std::optional<ScalarType> ply_type(std::string_view name) {
  for (const Names& names : kNames) {
    if (name == names.classic || name == names.sized) return names.type;
  }
  return std::nullopt;
}

}  // namespace lamina
