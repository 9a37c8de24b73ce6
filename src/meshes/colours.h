// Finding a mesh's colours among its attributes.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "lamina/attributes.h"
#include "lamina/mesh.h"

namespace lamina::meshes {

/// Which attributes are red, green, blue, and what brings their type's range to 0-255.
struct ColourColumns {
  std::array<std::size_t, 3> columns{};
  float scale = 1;
  [[nodiscard]] std::array<float, 3> at(const TriangleMesh& mesh, std::size_t vertex) const {
    return {scale * mesh.attributes[columns[0]][vertex], scale * mesh.attributes[columns[1]][vertex],
            scale * mesh.attributes[columns[2]][vertex]};
  }
};

/// What one unit of a colour channel's type is worth on the scale 0-255.
inline float colour_scale(ScalarType type) {
  switch (type) {
    case ScalarType::float32:
    case ScalarType::float64:
      return 255.0F;
    case ScalarType::int16:
    case ScalarType::uint16:
      return 255.0F / 65535.0F;
    default:
      return 1.0F;
  }
}

/// Between the encoded colours of files (sRGB) and linear ones, both 0-1.
inline double linear_of(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}
inline double encoded_of(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

/// Empty unless all three are there.
inline std::optional<ColourColumns> find_colours(const AttributeLayout& layout) {
  std::array<std::optional<std::size_t>, 3> found;
  for (std::size_t i = 0; i < layout.size(); ++i) {
    if (layout[i].name == "red") found[0] = i;
    if (layout[i].name == "green") found[1] = i;
    if (layout[i].name == "blue") found[2] = i;
  }
  if (!found[0] || !found[1] || !found[2]) return std::nullopt;
  return ColourColumns{{*found[0], *found[1], *found[2]}, colour_scale(layout[*found[0]].type)};
}
inline std::optional<ColourColumns> find_colours(const TriangleMesh& mesh) {
  return find_colours(mesh.layout);
}

}  // namespace lamina::meshes
