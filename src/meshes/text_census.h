// What an OBJ, OFF or STL file holds by its own account: the yardstick for readers that skip what they cannot parse.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "meshes/readers.h"

namespace lamina::meshes {

struct TextCensus {
  std::optional<std::uint64_t> vertices, faces;  ///< unset where the format does not tell
  bool binary = false;                           ///< STL, OFF
};

/// One pass from the start of `file`. Throws Error(unreadable) where the file contradicts itself (binary STL of the
/// wrong length, OFF without counts, OBJ with continued lines).
TextCensus take_census(FileBuffer& file, const std::string& path, TextFormat format);

}  // namespace lamina::meshes
