// What the writer and the reader of GLB (binary glTF 2.0) share: the container's words, the types
// of its numbers, and how a mesh lies that is too large for one.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/output_file.h"
#include "lamina/attributes.h"
#include "meshes/writers.h"

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

}  // namespace lamina::meshes
