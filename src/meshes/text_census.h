// What an OBJ or STL file holds by its own account: the yardstick for readers that skip what they cannot parse,
// and the positions of those that write them out in full, which OpenMesh rounds to float.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "meshes/readers.h"

namespace lamina::meshes {

struct TextCensus {
  std::optional<std::uint64_t> faces;            ///< unset where the format does not tell
  std::vector<std::array<double, 3>> positions;  ///< OBJ
  bool binary = false;                           ///< STL
};

/// One pass from the start of `file`. Throws Error(unreadable) where the file contradicts itself (a vertex that is
/// not three numbers, binary STL of the wrong length, OBJ with continued lines).
TextCensus take_census(FileBuffer& file, const std::string& path, TextFormat format);

}  // namespace lamina::meshes
