// What a GLB holds of each vertex.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "meshes/writers.h"

namespace lamina::meshes {

using GlbJson = nlohmann::ordered_json;

constexpr std::size_t kMostGlbColumn = 16;  ///< bytes of a vertex in one

/// One accessor of the vertices, in a buffer view of its own.
struct GlbColumn {
  std::string semantic;
  GlbJson accessor;        ///< without what all of them have
  std::size_t stride = 0;  ///< bytes of a vertex, a multiple of 4
  std::function<void(const TriangleMesh&, std::size_t, std::byte*)> encode{};
};

/// The box of the positions in double, and whether floats hold them.
struct GlbBox {
  std::array<double, 3> low{}, high{};
  std::array<double, 3> middle{};  ///< what is taken away from positions that floats do not hold
  bool floats = true;
};

/// Throws Error(usage) for positions that are not finite or too far apart for floats.
GlbBox glb_box_of(MeshBlocks& mesh, const std::string& name);

/// Positions, normals, colours and attributes of vertices in that box, which may be part of the mesh's.
std::vector<GlbColumn> glb_columns(const AttributeLayout& layout, bool normals, const GlbBox& box);

}  // namespace lamina::meshes
