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

/// What to do with vertices whose coordinates are NaN or infinite.
enum class NonFinite {
  refuse,  ///< Error(unreadable) naming the first
  keep,    ///< read as they stand: for `check`, which counts them
};

/// Reads OBJ, OFF, PLY or STL, each also as .gz, by extension and content; STL's equal positions are welded. PLY keeps
/// double positions and every scalar property of its vertices (lists are passed over); the other formats go through
/// OpenMesh, which holds positions as floats, and bring normals and colours. Every face is kept, non-manifold ones too.
/// A file without faces gives a mesh without triangles. Throws Error(unreadable) naming the file, the place and what is
/// wrong: missing, truncated, counts that lie, a face naming a vertex that is not there, a polygon of fewer than three.
TriangleMesh read_mesh(const std::string& path, NonFinite non_finite = NonFinite::refuse);

/// Writes OBJ, OFF, STL or PLY by extension; beside, then renamed. Throws Error(budget) when it cannot be written.
void write_mesh(const TriangleMesh& mesh, const std::string& path);

}  // namespace lamina
