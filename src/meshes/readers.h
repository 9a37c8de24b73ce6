// The formats' readers behind read_mesh().
#pragma once
#include <array>
#include <cstdint>
#include <istream>
#include <optional>
#include <string>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/file_stream.h"

namespace lamina::meshes {

/// PLY in all three encodings, double positions and any scalar attributes kept. Ours, because OpenMesh's reader rounds
/// positions to float and forgets attributes it does not know. Throws Error(unreadable).
TriangleMesh read_ply(FileBuffer& file, const std::string& path);

/// Ours as well: OpenMesh's reader takes a stream's colours and normals only when it has opened the same file by name
/// before.
TriangleMesh read_off(FileBuffer& file, const std::string& path);

/// GLB (binary glTF 2.0) whose data lie in it or beside it: the triangles of its scene, nodes' transforms applied;
/// normals, COLOR_0 as red green blue [alpha], encoded again, and attributes of one number (_NAME). Materials,
/// textures, skins and animations are passed over; geometry in compressing extensions is refused. Throws
/// Error(unreadable).
TriangleMesh read_glb(FileBuffer& file, const std::string& path);

/// Text formats do not say whether their colours reach to 1 or to 255: the largest value does.
void settle_colour_range(TriangleMesh& mesh);

enum class TextFormat { obj, stl };

/// Through OpenMesh's reader of the format, every face kept. Throws Error(unreadable).
TriangleMesh read_with_openmesh(FileBuffer& file, const std::string& path, TextFormat format);

/// What an OBJ or STL file holds by its own account: the yardstick for readers that skip what they cannot parse, and
/// the positions of those that write them out in full, which OpenMesh rounds to float.
struct TextCensus {
  std::optional<std::uint64_t> faces;            ///< unset where the format does not tell
  std::vector<std::array<double, 3>> positions;  ///< OBJ
  bool binary = false;                           ///< STL
};

/// One pass from the start of `file`. Throws Error(unreadable) where the file contradicts itself (a vertex that is
/// not three numbers, binary STL of the wrong length, OBJ with continued lines).
TextCensus take_census(FileBuffer& file, const std::string& path, TextFormat format);

}  // namespace lamina::meshes
