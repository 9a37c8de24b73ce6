// A triangle mesh held whole in memory: for measuring, checking, scattering and rendering; never on the streamed path.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/attributes.h"

namespace lamina {

struct TriangleMesh {
  std::vector<std::array<double, 3>> positions;
  std::vector<std::array<float, 3>> normals;  ///< per vertex, empty or one each
  AttributeLayout layout;                     ///< names and types of `attributes`; colours as in attributes.h
  std::vector<std::vector<float>> attributes;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< polygons come triangulated
};

/// Reads OBJ, OFF, PLY (also .gz of each) or STL by extension and content; STL's equal positions are welded.
/// Throws Error(unreadable) naming the file and what is wrong.
TriangleMesh read_mesh(const std::string& path);

/// Writes OBJ, OFF, STL or PLY by extension; beside, then renamed. Throws Error(budget) when it cannot be written.
void write_mesh(const TriangleMesh& mesh, const std::string& path);

}  // namespace lamina
