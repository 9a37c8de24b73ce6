// Some of a mesh's vertices.
#pragma once
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"

namespace lamina::edit {

/// The vertices v with keep[v] != 0 in order, and the triangles all of whose corners stay.
TriangleMesh only_vertices(const TriangleMesh& mesh, const std::vector<std::uint8_t>& keep);

/// Without the vertices that are in no triangle.
TriangleMesh without_unused_vertices(TriangleMesh mesh);

}  // namespace lamina::edit
