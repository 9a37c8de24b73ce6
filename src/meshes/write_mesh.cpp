#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <type_traits>
#include <utility>

#include "base/little_endian.h"
#include "base/output_file.h"
#include "base/scalar_type.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "lamina/mesh.h"
#include "meshes/colours.h"
#include "meshes/vec3.h"
#include "meshes/writers.h"

namespace lamina::meshes {
namespace {

constexpr std::size_t kTextBytes = 1u << 20;

/// Collects text and hands it on in large pieces.
class Text {
 public:
  explicit Text(ResultFile& out) : out_(out) {}
  /// Numbers come in the shortest form that reads back as the same bits.
  template <class... Args>
  void add(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(bytes), format, std::forward<Args>(args)...);
    if (bytes.size() >= kTextBytes) flush();
  }
  void flush() {
    out_.write(bytes);
    bytes.clear();
  }
  std::string bytes;

 private:
  ResultFile& out_;
};

constexpr std::size_t kFlushBytes = 1u << 20;

template <class T>
void put_rounded(std::string& bytes, float value) {
  const double rounded = std::isnan(value) ? 0.0 : std::round(static_cast<double>(value));
  append_little(bytes, static_cast<T>(std::clamp(rounded, static_cast<double>(std::numeric_limits<T>::lowest()),
                                                 static_cast<double>(std::numeric_limits<T>::max()))));
}

void put_attribute(std::string& bytes, ScalarType type, float value) {
  with_scalar_type(type, [&](auto zero) {
    using T = decltype(zero);
    if constexpr (std::is_floating_point_v<T>) {
      append_little(bytes, static_cast<T>(value));
    } else {
      put_rounded<T>(bytes, value);
    }
  });
}

}  // namespace

void write_obj(const TriangleMesh& mesh, ResultFile& out) {
  const auto colours = find_colours(mesh);
  Text text(out);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const auto& p = mesh.positions[v];
    text.add("v {} {} {}", p[0], p[1], p[2]);
    if (colours) {
      const auto c = colours->at(mesh, v);
      text.add(" {:.4g} {:.4g} {:.4g}", c[0] / 255, c[1] / 255, c[2] / 255);
    }
    text.add("\n");
  }
  for (const auto& n : mesh.normals) text.add("vn {} {} {}\n", n[0], n[1], n[2]);
  for (const auto& t : mesh.triangles) {
    const std::uint64_t a = t[0] + 1ull, b = t[1] + 1ull, c = t[2] + 1ull;
    if (mesh.normals.empty())
      text.add("f {} {} {}\n", a, b, c);
    else
      text.add("f {0}//{0} {1}//{1} {2}//{2}\n", a, b, c);
  }
  text.flush();
}

void write_off(const TriangleMesh& mesh, ResultFile& out) {
  const auto colours = find_colours(mesh);
  Text text(out);
  text.add("{}{}OFF\n{} {} 0\n", colours ? "C" : "", mesh.normals.empty() ? "" : "N", mesh.positions.size(),
           mesh.triangles.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const auto& p = mesh.positions[v];
    text.add("{} {} {}", p[0], p[1], p[2]);
    if (!mesh.normals.empty()) text.add(" {} {} {}", mesh.normals[v][0], mesh.normals[v][1], mesh.normals[v][2]);
    if (colours) {
      for (const float c : colours->at(mesh, v)) text.add(" {}", std::lround(std::clamp(c, 0.0F, 255.0F)));
      text.add(" 255");
    }
    text.add("\n");
  }
  for (const auto& t : mesh.triangles) text.add("3 {} {} {}\n", t[0], t[1], t[2]);
  text.flush();
}

void write_stl(const TriangleMesh& mesh, ResultFile& out) {
  std::string bytes = "binary STL";
  bytes.resize(80, ' ');
  append_little(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const auto& t : mesh.triangles) {
    const Vec3 a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    for (const Vec3& row : {unit(cross(b - a, c - a)), a, b, c})
      for (const double x : row) append_little(bytes, static_cast<float>(x));
    append_little(bytes, std::uint16_t{0});
    if (bytes.size() >= kTextBytes) {
      out.write(bytes);
      bytes.clear();
    }
  }
  out.write(bytes);
}

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
  for (const auto& a : mesh.layout) bytes += fmt::format("property {} {}\n", ply_name(a.type), a.name);
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
        append_little(bytes, static_cast<float>(c));
      else
        append_little(bytes, c);
    }
    if (!mesh.normals.empty())
      for (const float c : mesh.normals[v]) append_little(bytes, c);
    for (std::size_t a = 0; a < mesh.layout.size(); ++a)
      put_attribute(bytes, mesh.layout[a].type, mesh.attributes[a][v]);
    flush(kFlushBytes);
  }
  for (const auto& t : mesh.triangles) {
    append_little(bytes, std::uint8_t{3});
    for (const auto v : t) append_little(bytes, v);
    flush(kFlushBytes);
  }
  flush(1);
}

}  // namespace lamina::meshes
namespace lamina {

void write_mesh(const TriangleMesh& mesh, const std::string& path) {
  using Writer = void (*)(const TriangleMesh&, ResultFile&);
  static constexpr std::array<std::pair<const char*, Writer>, 4> kWriters{{{".ply", meshes::write_ply},
                                                                           {".obj", meshes::write_obj},
                                                                           {".off", meshes::write_off},
                                                                           {".stl", meshes::write_stl}}};
  for (const auto& [format, write] : kWriters) {
    const bool standard = path == "-" && format == kWriters.front().first;
    if (path.ends_with(".gz") || (packed_ending(path) != format && !standard)) continue;
    ResultFile out(path);
    write(mesh, out);
    out.commit();
    return;
  }
  throw Error(ExitCode::usage, fmt::format("{}: unknown mesh format to write; known are .ply, .obj, .off, .stl", path));
}

}  // namespace lamina
