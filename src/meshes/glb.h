// What the writer and the reader of GLB (binary glTF 2.0) share: the container's words, the types
// of its numbers, and how a mesh lies that is too large for one.
#pragma once
#include <nlohmann/json.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/number.h"
#include "base/output_file.h"
#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "meshes/formats.h"

namespace lamina::meshes::glb {

inline constexpr std::uint32_t kMagic = 0x46546C67;      ///< "glTF"
inline constexpr std::uint32_t kJsonChunk = 0x4E4F534A;  ///< "JSON"
inline constexpr std::uint32_t kDataChunk = 0x004E4942;  ///< "BIN"
inline constexpr std::uint32_t kVersion = 2;
inline constexpr std::size_t kHeaderBytes = 12;
inline constexpr std::size_t kChunkHeaderBytes = 8;

/// The numbers of an accessor.
enum Component : std::uint32_t { kByte = 5120, kUbyte, kShort, kUshort, kUint = 5125, kFloat = 5126 };

/// glTF allows no whole numbers of 32 bits for vertices, and no doubles: those are floats, as they are in memory.
inline Component component_of(ScalarType type) {
  switch (type) {
    case ScalarType::int8:
      return kByte;
    case ScalarType::uint8:
      return kUbyte;
    case ScalarType::int16:
      return kShort;
    case ScalarType::uint16:
      return kUshort;
    default:
      return kFloat;
  }
}

/// The semantic of an attribute that glTF knows nothing of: "_CURVATURE" of "curvature".
inline std::string semantic_of(std::string_view attribute) {
  std::string semantic = "_";
  for (const char c : attribute) semantic += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  return semantic;
}

}  // namespace lamina::meshes::glb

namespace lamina::meshes {

/// A mesh that is too large for one GLB: its first piece in the GLB, the others in files beside it. The triangles in
/// their order, a primitive for each buffer with vertices of its own, some of which others have as well: which of the
/// mesh's they are is noted, so that reading makes it one again. Files are named NAME.1.SUM.bin by what is in them, so
/// that those of an older mesh stay until the new GLB has replaced the one that names them. Keeps two bits for each
/// vertex of the mesh, and blocks. Throws Error(budget) where `out` is a pipe or device; else as write_glb() does.
void write_glb_set(MeshBlocks& mesh, ResultFile& out, const GlbLimits& limits);

/// The files with such names that the GLB at `path` says its data lie in; none where it is no GLB of that kind.
std::vector<std::string> companions_of_glb(const std::string& path);

/// A file's name as a relative URI, and back; nothing where it would lead out of the folder or to another place.
std::string uri_of_file(const std::string& name);
std::optional<std::string> file_of_uri(const std::string& uri);

// A GLB as it is written: what it holds of each vertex, its JSON, and its bytes on their way to the file.

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

/// What one buffer holds of a mesh: columns of vertices, triangles that count from the first of these, and which of the
/// mesh's vertices these are.
struct GlbPiece {
  std::uint64_t vertices = 0, triangles = 0;
  GlbBox box{};            ///< of its positions
  std::uint64_t runs = 0;  ///< of vertices that follow each other in the mesh; 0: it has all of them
  std::string uri{};       ///< of the file that holds it; empty: the GLB itself
};

inline constexpr std::size_t kGlbTriangleBytes = 3 * sizeof(std::uint32_t);
inline constexpr std::size_t kGlbRunBytes = 2 * sizeof(std::uint32_t);  ///< the first vertex, and how many

/// Everything but the data: one mesh of one node, a primitive for each piece. In the buffers pieces' columns follow
/// each other, then triangles, then runs. Filled up with spaces to four bytes.
std::string describe_glb(const MeshBlocks& mesh, const std::vector<GlbPiece>& pieces);

/// Bytes handed on in large pieces.
class GlbBytes {
 public:
  using Sink = std::function<void(std::string_view)>;
  explicit GlbBytes(const Sink& out) : out_(out) { bytes_.reserve(kHeld + kMostGlbColumn); }
  template <class T>
  void add(T value) {
    append_little(bytes_, value);
    if (bytes_.size() >= kHeld) flush();
  }
  void add(const std::byte* from, std::size_t count) {
    bytes_.append(reinterpret_cast<const char*>(from), count);
    if (bytes_.size() >= kHeld) flush();
  }
  /// What the container begins with: its length, the JSON, and the head of the data.
  void add_head(const std::string& json, std::uint64_t data);
  void flush() {
    out_(bytes_);
    bytes_.clear();
  }

 private:
  static constexpr std::size_t kHeld = 1U << 20;
  const Sink& out_;
  std::string bytes_;
};

/// Of the whole file.
std::uint64_t glb_file_bytes(const std::string& json, std::uint64_t data);

}  // namespace lamina::meshes
