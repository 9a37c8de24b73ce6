// A triangle mesh held whole in memory: for measuring, checking, scattering and rendering; never on the streamed path.
#pragma once
#include <array>
#include <cstddef>
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
  keep,    ///< read as they stand, from PLY: for those who count them, or drop_non_finite()
};

/// Reads OBJ, OFF, PLY or STL, each also as .gz, by extension and content; STL's equal positions are welded. PLY keeps
/// every scalar property of its vertices (lists are passed over); the other formats bring normals
/// and colours. Positions keep double precision, except in STL, whose own precision is float. Every face is
/// kept, non-manifold ones too. A file without faces gives a mesh without triangles. Throws Error(unreadable) naming
/// the file, the place and what is wrong: missing, truncated, counts that lie, a face naming a vertex that is not
/// there, a polygon of fewer than three.
TriangleMesh read_mesh(const std::string& path, NonFinite non_finite = NonFinite::refuse);

/// Leaves out vertices that are not finite, with the triangles at them; the others keep their order. Returns how many
/// vertices went.
std::size_t drop_non_finite(TriangleMesh& mesh);

/// Writes PLY, OBJ, OFF or STL by extension; beside, then renamed. "-" is standard output, as PLY. Positions read back
/// as the same bits (as floats from STL). Throws Error(budget) when the file cannot be written, Error(usage) for
/// another extension.
void write_mesh(const TriangleMesh& mesh, const std::string& path);

}  // namespace lamina
