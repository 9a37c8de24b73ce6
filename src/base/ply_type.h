// Names of scalar types in PLY headers.
#pragma once
#include <optional>
#include <string_view>

#include "lamina/attributes.h"

namespace lamina {

/// The classic name: char uchar short ushort int uint float double.
std::string_view ply_name(ScalarType type);

/// Both families of names: the classic ones and int8 ... float64.
std::optional<ScalarType> ply_type(std::string_view name);

}  // namespace lamina
