// Samples as they come from a file, and the scalar attributes that they and vertices carry besides position and normal:
// colours, and anything else in the file.
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lamina {

/// The types of PLY: integers of 1, 2 and 4 bytes, and floating point numbers of 4 and 8.
enum class ScalarType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

/// Bytes of one value.
constexpr int byte_size(ScalarType t) {
  switch (t) {
    case ScalarType::int8:
    case ScalarType::uint8:
      return 1;
    case ScalarType::int16:
    case ScalarType::uint16:
      return 2;
    case ScalarType::int32:
    case ScalarType::uint32:
    case ScalarType::float32:
      return 4;
    case ScalarType::float64:
      return 8;
  }
  return 0;
}

/// True when a 32-bit float holds every value of the type exactly.
constexpr bool fits_float(ScalarType t) {
  return t == ScalarType::float32 || byte_size(t) < 4;
}

/// One attribute. Colours are the attributes `red green blue [alpha]` in the type they came in; they are interpolated
/// as floats in that type's own range (0-255, 0-65535 or 0-1) and rounded and clamped to it when written.
struct AttributeSpec {
  std::string name;
  ScalarType type = ScalarType::float32;
  bool operator==(const AttributeSpec&) const = default;
};

/// True for the names of colour channels: red, green, blue, alpha.
inline bool is_colour(std::string_view name) {
  return name == "red" || name == "green" || name == "blue" || name == "alpha";
}

/// The attributes of a cloud or mesh, in the order of their arrays.
using AttributeLayout = std::vector<AttributeSpec>;

/// The index of the first attribute of that name; empty when there is none.
inline std::optional<std::size_t> find_attribute(const AttributeLayout& layout, const std::string& name) {
  for (std::size_t i = 0; i < layout.size(); ++i)
    if (layout[i].name == name) return i;
  return std::nullopt;
}

/// Samples as they come from a file, in its own coordinates. Structure of arrays; every non-empty array has size()
/// entries. Reused between reads to keep its memory.
struct SampleBatch {
  std::uint64_t first = 0;                     ///< row number in the input of the first sample
  std::vector<double> x, y, z;                 ///< positions, input coordinates
  std::vector<float> nx, ny, nz;               ///< normals as read (any length), empty when the source has none
  std::vector<float> radius;                   ///< influence radius, input units; empty when the source has none
  std::vector<float> quality;                  ///< quality or confidence; empty when the source has none
  std::vector<std::vector<float>> attributes;  ///< one array per attribute of the source's layout
  /// One array per attribute: the values of those whose type a float cannot hold (ids, times), empty for the others.
  /// Sources fill it; who makes batches may leave it empty.
  std::vector<std::vector<double>> exact;

  [[nodiscard]] std::size_t size() const { return x.size(); }
};

/// What a job does about samples it cannot use.
enum class BadSamples { drop, refuse };

}  // namespace lamina
