// Mesh files by format: their readers and writers. The writers are ours: OpenMesh's hold the mesh and round positions
// to float, and its OBJ writer refuses colours.
#pragma once
#include <zlib.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <istream>
#include <optional>
#include <streambuf>
#include <string>
#include <string_view>
#include <vector>

#include "base/output_file.h"
#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/run.h"
#include "meshes/mesh_blocks.h"

namespace lamina::meshes {

/// zlib passes plain files through unchanged, so a reader never asks which kind it has.
class FileBuffer : public std::streambuf {
 public:
  /// "-" is standard input, which must be a file read from its beginning: a pipe cannot be read twice.
  /// Throws Error(unreadable) when `path` is missing, a directory or not permitted.
  explicit FileBuffer(const std::string& path);
  ~FileBuffer() override;
  FileBuffer(const FileBuffer&) = delete;
  FileBuffer& operator=(const FileBuffer&) = delete;

  /// Throws Error(unreadable) when decompression or the disk failed so far: a plain end of file does not look different
  /// to the formats' readers, so they must ask once they are through.
  void require_sound() const;
  /// Bytes on disk (compressed size for .gz).
  [[nodiscard]] std::uint64_t disk_bytes() const { return disk_bytes_; }
  [[nodiscard]] bool compressed() const { return compressed_; }

 protected:
  int_type underflow() override;
  pos_type seekoff(off_type offset, std::ios_base::seekdir way, std::ios_base::openmode which) override;
  pos_type seekpos(pos_type position, std::ios_base::openmode which) override;

 private:
  std::string path_;
  gzFile file_ = nullptr;
  std::vector<char> buffer_;
  std::uint64_t disk_bytes_ = 0;
  bool compressed_ = false;
  std::string failure_;
};

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

namespace lamina {

// The formats a mesh is written in, by the ending of its name, and the writers behind write_mesh() and the streamed
// meshes.
struct MeshSinkSettings;
}  // namespace lamina

namespace lamina::meshes {

enum class MeshFormat : std::uint8_t { ply, obj, off, stl, glb };

/// How much goes into the files of a GLB.
struct GlbLimits {
  std::uint64_t file = 0xFFFFFFFF;  ///< the GLB's own length has 32 bits
  /// Of each piece where one file does not hold all of a mesh: what programs like to have in one array.
  std::uint64_t buffer = 2'000'000'000;
};

/// By the ending, in any case; nothing for another one.
std::optional<MeshFormat> known_mesh_format(std::string_view path);

/// The same; PLY for every name that says nothing else: "-", pipes, names without an ending.
MeshFormat mesh_format(std::string_view path);

/// Warns of the properties of a mesh that the formats of its names cannot hold, a line for each.
void warn_of_losses(const MeshSinkSettings& mesh, const RunContext& run);

/// Positions as float where that loses nothing, else double; normals; attributes in their own types (rounded and
/// clamped to them); faces as `list uchar int vertex_indices` (uint beyond 2^31 - 1 vertices).
void write_ply(const TriangleMesh& mesh, ResultFile& out);

/// Bytes of a GLB's data where one buffer holds it.
std::uint64_t glb_data_bytes(const AttributeLayout& layout, bool normals, std::uint64_t vertices,
                             std::uint64_t triangles);

/// GLB, binary glTF 2.0: one mesh of one node, each of positions, normals, colours and attributes in a piece of its
/// own. Positions are floats; where those lose something, floats from a middle that the node's translation holds in
/// double. Colours become linear, as glTF has them, in numbers from which they come back unchanged. Normals of no
/// length become 0 0 1, others of another length than 1 are made unit; attributes that are not finite become 0. Meshes
/// beyond what one file holds are split into primitives with files of their own (glb.h). Throws Error(usage) for
/// positions that are not finite or too far apart for floats.
void write_glb(MeshBlocks& mesh, ResultFile& out, const GlbLimits& limits = {});

/// The same of a mesh in memory, or of points where it has no triangles, handed on in pieces; `name` is for messages.
/// Throws Error(budget) for meshes beyond 4 GB.
void write_glb(const TriangleMesh& mesh, const std::string& name, const std::function<void(std::string_view)>& sink);
void write_glb(MeshBlocks& mesh, const std::string& name, const std::function<void(std::string_view)>& sink);

/// Of the other formats. Keeps blocks, for STL at most a million positions, too.
/// OBJ: `v x y z [r g b]` with colours from 0 to 1, `vn`, faces `f v//vn`. Positions read back as the same bits.
/// OFF: [C][N]OFF with colours as r g b a bytes. Positions read back as the same bits.
/// STL: positions as floats, facet normals computed; vertices and colours are not shared by this format. Throws
/// Error(budget) for more than 2^32 - 1 triangles.
void write_blocks(MeshBlocks& mesh, MeshFormat format, ResultFile& out, const GlbLimits& limits = {});

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
inline float colour_scale(ScalarType type) {
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

/// Between the encoded colours of files (sRGB) and linear ones, both 0-1.
inline double linear_of(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}
inline double encoded_of(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

/// Empty unless all three are there.
inline std::optional<ColourColumns> find_colours(const AttributeLayout& layout) {
  std::array<std::optional<std::size_t>, 3> found;
  for (std::size_t i = 0; i < layout.size(); ++i) {
    if (layout[i].name == "red") found[0] = i;
    if (layout[i].name == "green") found[1] = i;
    if (layout[i].name == "blue") found[2] = i;
  }
  if (!found[0] || !found[1] || !found[2]) return std::nullopt;
  return ColourColumns{{*found[0], *found[1], *found[2]}, colour_scale(layout[*found[0]].type)};
}
inline std::optional<ColourColumns> find_colours(const TriangleMesh& mesh) {
  return find_colours(mesh.layout);
}

}  // namespace lamina::meshes
