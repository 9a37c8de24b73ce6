#include "meshes/colours.h"

namespace lamina::meshes {
namespace {

/// What one unit of the type is worth on the scale 0-255.
float scale_of(ScalarType type) {
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

}  // namespace

std::optional<ColourColumns> find_colours(const AttributeLayout& layout) {
  std::array<std::optional<std::size_t>, 3> found;
  for (std::size_t i = 0; i < layout.size(); ++i) {
    if (layout[i].name == "red") found[0] = i;
    if (layout[i].name == "green") found[1] = i;
    if (layout[i].name == "blue") found[2] = i;
  }
  if (!found[0] || !found[1] || !found[2]) return std::nullopt;
  return ColourColumns{{*found[0], *found[1], *found[2]}, scale_of(layout[*found[0]].type)};
}

std::optional<ColourColumns> find_colours(const TriangleMesh& mesh) {
  return find_colours(mesh.layout);
}

}  // namespace lamina::meshes
