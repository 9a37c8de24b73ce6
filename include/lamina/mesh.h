// Triangle meshes held in memory, for measuring, checking, scattering and rendering. Reconstruction never holds one: it
// streams.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/run.h"

namespace lamina {

/// Vertices and the triangles that index them; seen from outside these run counter-clockwise.
struct TriangleMesh {
  std::vector<std::array<double, 3>> positions;         ///< in the units of the file
  std::vector<std::array<float, 3>> normals;            ///< one for each vertex, of any length; or empty
  AttributeLayout layout;                               ///< names and types of `attributes`; colours as in attributes.h
  std::vector<std::vector<float>> attributes;           ///< one array for each attribute, one value for each vertex
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< vertex indices
};

/// What to do with vertices whose coordinates are NaN or infinite.
enum class NonFinite {
  refuse,  ///< Error(unreadable) naming the first
  keep,    ///< read as they stand (PLY only), to be counted or dropped (drop_non_finite())
};

/// Reads OBJ, OFF, PLY, STL or GLB, each also as .gz, by extension and content. PLY brings every scalar property of its
/// vertices (lists are skipped), GLB its attributes of one number, the other formats normals and colours. Positions
/// keep double precision, except in STL, which holds floats and whose equal positions are welded. Polygons are
/// triangulated, and every face is kept, also where the mesh is not manifold. A file without faces gives a mesh without
/// triangles. Throws Error(unreadable) naming the file, the place and what is wrong: missing, truncated, wrong counts,
/// a face with a vertex that is not there or with fewer than three.
TriangleMesh read_mesh(const std::string& path, NonFinite non_finite = NonFinite::refuse);

/// Drops vertices that are not finite and the triangles at them; the others keep their order. Returns the number of
/// vertices dropped.
std::size_t drop_non_finite(TriangleMesh& mesh);

/// Writes PLY, OBJ, OFF, STL or GLB, by extension; "-" is standard output, as PLY. The file appears under its name when
/// it is complete. Positions read back as the same bits (from STL as floats, from GLB as floats from a middle). Throws
/// Error(budget) when the file cannot be written, Error(usage) for another extension.
void write_mesh(const TriangleMesh& mesh, const std::string& path);

/// A mesh file that went into another format, piece by piece.
struct ConvertedMesh {
  std::uint64_t vertices = 0, triangles = 0;
};

/// Writes a mesh file that need not fit in memory as OBJ, OFF, STL or GLB: what write_mesh() writes of it, byte for
/// byte. Of a binary PLY of triangles with normals, as this program writes them, whose positions are all finite;
/// nothing, and nothing written, for all others, which are to be read whole. Throws what write_mesh() throws,
/// Error(internal) when cancelled.
std::optional<ConvertedMesh> convert_mesh_file(const std::string& from, const std::string& to,
                                               const RunContext& run = {});

}  // namespace lamina
