// Colours in their type's range and in 0..1.
#pragma once
#include "lamina/attributes.h"

namespace lamina::volume {

/// What is 1 in `Cd`.
constexpr float full_range(ScalarType type) {
  return type == ScalarType::uint8 ? 255.0F : type == ScalarType::uint16 ? 65535.0F : 1.0F;
}

}  // namespace lamina::volume
