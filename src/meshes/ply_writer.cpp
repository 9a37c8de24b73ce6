#include "meshes/ply_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/little_endian.h"

namespace lamina::meshes {
namespace {

constexpr std::size_t kFlushBytes = 1u << 20;

const char* type_name(ScalarType t) {
  switch (t) {
    case ScalarType::int8:
      return "char";
    case ScalarType::uint8:
      return "uchar";
    case ScalarType::int16:
      return "short";
    case ScalarType::uint16:
      return "ushort";
    case ScalarType::int32:
      return "int";
    case ScalarType::uint32:
      return "uint";
    case ScalarType::float32:
      return "float";
    case ScalarType::float64:
      return "double";
  }
  return "float";
}

template <class T>
void put_rounded(std::string& bytes, float value) {
  const double rounded = std::isnan(value) ? 0.0 : std::round(static_cast<double>(value));
  put_little(bytes, static_cast<T>(std::clamp(rounded, static_cast<double>(std::numeric_limits<T>::lowest()),
                                              static_cast<double>(std::numeric_limits<T>::max()))));
}

void put_attribute(std::string& bytes, ScalarType type, float value) {
  switch (type) {
    case ScalarType::int8:
      return put_rounded<std::int8_t>(bytes, value);
    case ScalarType::uint8:
      return put_rounded<std::uint8_t>(bytes, value);
    case ScalarType::int16:
      return put_rounded<std::int16_t>(bytes, value);
    case ScalarType::uint16:
      return put_rounded<std::uint16_t>(bytes, value);
    case ScalarType::int32:
      return put_rounded<std::int32_t>(bytes, value);
    case ScalarType::uint32:
      return put_rounded<std::uint32_t>(bytes, value);
    case ScalarType::float32:
      return put_little(bytes, value);
    case ScalarType::float64:
      return put_little(bytes, static_cast<double>(value));
  }
}

}  // namespace

bool fits_float(const TriangleMesh& mesh) {
  return std::all_of(mesh.positions.begin(), mesh.positions.end(), [](const auto& p) {
    return std::all_of(p.begin(), p.end(),
                       [](double c) { return std::isnan(c) || static_cast<double>(static_cast<float>(c)) == c; });
  });
}

void write_ply(const TriangleMesh& mesh, ResultFile& out) {
  const bool as_float = fits_float(mesh);
  std::string bytes = fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.size());
  for (const char* axis : {"x", "y", "z"})
    bytes += fmt::format("property {} {}\n", as_float ? "float" : "double", axis);
  if (!mesh.normals.empty()) bytes += "property float nx\nproperty float ny\nproperty float nz\n";
  for (const auto& a : mesh.layout) bytes += fmt::format("property {} {}\n", type_name(a.type), a.name);
  const bool wide = mesh.positions.size() > 0x7FFFFFFFu;
  bytes += fmt::format("element face {}\nproperty list uchar {} vertex_indices\nend_header\n", mesh.triangles.size(),
                       wide ? "uint" : "int");
  const auto flush = [&](std::size_t at_least) {
    if (bytes.size() < at_least) return;
    out.write(bytes);
    bytes.clear();
  };
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    for (const double c : mesh.positions[v]) {
      if (as_float)
        put_little(bytes, static_cast<float>(c));
      else
        put_little(bytes, c);
    }
    if (!mesh.normals.empty())
      for (const float c : mesh.normals[v]) put_little(bytes, c);
    for (std::size_t a = 0; a < mesh.layout.size(); ++a)
      put_attribute(bytes, mesh.layout[a].type, mesh.attributes[a][v]);
    flush(kFlushBytes);
  }
  for (const auto& t : mesh.triangles) {
    put_little(bytes, std::uint8_t{3});
    for (const auto v : t) put_little(bytes, v);
    flush(kFlushBytes);
  }
  flush(1);
}

}  // namespace lamina::meshes
