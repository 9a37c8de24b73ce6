// Edges of a mesh that only one triangle uses.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"

namespace lamina::render_detail {

using Edge = std::array<std::uint32_t, 2>;  ///< vertex numbers, ascending

/// In ascending order.
std::vector<Edge> boundary_edges(const TriangleMesh& mesh);

}  // namespace lamina::render_detail
