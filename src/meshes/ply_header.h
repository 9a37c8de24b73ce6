// The header of a PLY file as a list of elements; shared by nothing else than the mesh reader.
#pragma once
#include <cstdint>
#include <istream>
#include <optional>
#include <string>
#include <vector>

#include "lamina/attributes.h"

namespace lamina::meshes {

struct PlyProperty {
  std::string name;
  ScalarType type = ScalarType::float32;
  std::optional<ScalarType> count_type;  ///< set for lists
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
  [[nodiscard]] std::optional<std::size_t> find(std::string_view property) const;
};

enum class PlyEncoding { ascii, little, big };

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::ascii;
  std::vector<PlyElement> elements;
};

/// Reads up to and including the `end_header` line. Throws Error(unreadable) naming the line.
PlyHeader read_ply_header(std::istream& in, const std::string& path);

}  // namespace lamina::meshes
