#include "meshes/text_writers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/little_endian.h"
#include "meshes/colours.h"
#include "meshes/vec3.h"

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
  put_little(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const auto& t : mesh.triangles) {
    const Vec3 a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
    for (const Vec3& row : {unit(cross(b - a, c - a)), a, b, c})
      for (const double x : row) put_little(bytes, static_cast<float>(x));
    put_little(bytes, std::uint16_t{0});
    if (bytes.size() >= kTextBytes) {
      out.write(bytes);
      bytes.clear();
    }
  }
  out.write(bytes);
}

}  // namespace lamina::meshes
