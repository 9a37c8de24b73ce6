// Finding a mesh's colours among its attributes.
#pragma once
#include <array>
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
float colour_scale(ScalarType type);

/// Between the encoded colours of files (sRGB) and linear ones, both 0-1.
double linear_of(double encoded);
double encoded_of(double linear);

/// Empty unless all three are there.
std::optional<ColourColumns> find_colours(const AttributeLayout& layout);
std::optional<ColourColumns> find_colours(const TriangleMesh& mesh);

}  // namespace lamina::meshes
