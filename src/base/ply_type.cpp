#include "base/ply_type.h"

#include <array>

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
