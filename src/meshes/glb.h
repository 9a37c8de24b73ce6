// What the writer and the reader of GLB (binary glTF 2.0) share: the container's words and the types of its numbers.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "lamina/attributes.h"

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
