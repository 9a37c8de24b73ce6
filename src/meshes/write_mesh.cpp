#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/number.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "lamina/mesh.h"
#include "meshes/formats.h"
#include "meshes/mesh_blocks.h"
#include "meshes/mesh_sink.h"
#include "meshes/stored_mesh.h"
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
    fmt::format_to(std::back_inserter(bytes_), format, std::forward<Args>(args)...);
    if (bytes_.size() >= kTextBytes) flush();
  }
  void flush() {
    out_.write(bytes_);
    bytes_.clear();
  }

 private:
  std::string bytes_;
  ResultFile& out_;
};

void write_obj(MeshBlocks& mesh, ResultFile& out) {
  const auto colours = find_colours(mesh.layout());
  Text text(out);
  for (const std::string& comment : mesh.comments()) text.add("# {}\n", comment);
  for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
    const auto& p = block.positions[v];
    text.add("v {} {} {}", p[0], p[1], p[2]);
    if (colours) {
      const auto c = colours->at(block, v);
      text.add(" {:.4g} {:.4g} {:.4g}", c[0] / 255, c[1] / 255, c[2] / 255);
    }
    text.add("\n");
  });
  if (mesh.has_normals()) {
    for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
      const auto& n = block.normals[v];
      text.add("vn {} {} {}\n", n[0], n[1], n[2]);
    });
  }
  for_triangles(mesh, [&](const std::array<std::uint32_t, 3>& t) {
    const std::uint64_t a = t[0] + 1ull, b = t[1] + 1ull, c = t[2] + 1ull;
    if (mesh.has_normals())
      text.add("f {0}//{0} {1}//{1} {2}//{2}\n", a, b, c);
    else
      text.add("f {} {} {}\n", a, b, c);
  });
  text.flush();
}

void write_off(MeshBlocks& mesh, ResultFile& out) {
  const auto colours = find_colours(mesh.layout());
  Text text(out);
  text.add("{}{}OFF\n{} {} 0\n", colours ? "C" : "", mesh.has_normals() ? "N" : "", mesh.vertices(), mesh.triangles());
  for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
    const auto& p = block.positions[v];
    text.add("{} {} {}", p[0], p[1], p[2]);
    if (mesh.has_normals()) text.add(" {} {} {}", block.normals[v][0], block.normals[v][1], block.normals[v][2]);
    if (colours) {
      for (const float c : colours->at(block, v)) text.add(" {}", std::lround(std::clamp(c, 0.0F, 255.0F)));
      text.add(" 255");
    }
    text.add("\n");
  });
  for_triangles(mesh, [&](const std::array<std::uint32_t, 3>& t) { text.add("3 {} {} {}\n", t[0], t[1], t[2]); });
  text.flush();
}

/// Positions by number. Triangles name vertices near those of the triangles before, so blocks of them are kept.
class KeptPositions {
 public:
  explicit KeptPositions(MeshBlocks& mesh)
      : mesh_(mesh), seats_(std::min<std::uint64_t>(kMostBlocks, mesh.vertices() / kBlockRows + 1)) {}

  Vec3 at(std::uint32_t vertex) {
    const std::uint64_t block = vertex / kBlockRows;
    Seat& seat = seats_[block % seats_.size()];
    if (seat.block != block) load(block, seat);
    return seat.positions[vertex % kBlockRows];
  }

 private:
  static constexpr std::uint64_t kMostBlocks = 256;  ///< a million vertices: more than most cross-sections have
  struct Seat {
    std::uint64_t block = std::numeric_limits<std::uint64_t>::max();
    std::vector<Vec3> positions;
  };

  void load(std::uint64_t block, Seat& seat) {
    const std::uint64_t first = block * kBlockRows;
    mesh_.read_vertices(first, std::min<std::uint64_t>(kBlockRows, mesh_.vertices() - first), read_);
    seat.positions = read_.positions;
    seat.block = block;
  }

  MeshBlocks& mesh_;
  std::vector<Seat> seats_;
  TriangleMesh read_;
};

void write_stl(MeshBlocks& mesh, ResultFile& out) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (mesh.triangles() > kMost) {
    throw Error(ExitCode::budget, fmt::format("{}: STL counts at most {} triangles, the mesh has {}; write a .ply",
                                              out.name(), kMost, mesh.triangles()));
  }
  std::string bytes = "binary STL";
  bytes.resize(80, ' ');
  append_little(bytes, static_cast<std::uint32_t>(mesh.triangles()));
  KeptPositions positions(mesh);
  for_triangles(mesh, [&](const std::array<std::uint32_t, 3>& t) {
    const Vec3 a = positions.at(t[0]), b = positions.at(t[1]), c = positions.at(t[2]);
    for (const Vec3& row : {unit(area_normal(a, b, c)), a, b, c})
      for (const double x : row) append_little(bytes, static_cast<float>(x));
    append_little(bytes, std::uint16_t{0});
    if (bytes.size() >= kTextBytes) {
      out.write(bytes);
      bytes.clear();
    }
  });
  out.write(bytes);
}

}  // namespace

void write_blocks(MeshBlocks& mesh, MeshFormat format, ResultFile& out, const GlbLimits& limits) {
  switch (format) {
    case MeshFormat::obj:
      return write_obj(mesh, out);
    case MeshFormat::off:
      return write_off(mesh, out);
    case MeshFormat::stl:
      return write_stl(mesh, out);
    case MeshFormat::glb:
      return write_glb(mesh, out, limits);
    case MeshFormat::ply:
      break;
  }
  throw Error(ExitCode::internal, "a PLY is written from its records, not block by block");
}

namespace {

/// One line about what the format of a name cannot hold; empty where nothing is lost.
std::string describe_losses(const MeshSinkSettings& mesh, const std::string& path) {
  const MeshFormat format = mesh_format(path);
  if (format == MeshFormat::ply || format == MeshFormat::glb) return {};
  const bool bare = format == MeshFormat::stl;
  const bool coloured = !bare && find_colours(mesh.attributes);
  std::string names;
  for (const AttributeSpec& attribute : mesh.attributes) {
    const bool colour = attribute.name == "red" || attribute.name == "green" || attribute.name == "blue";
    if (!(coloured && colour)) names += (names.empty() ? "" : ", ") + attribute.name;
  }
  const std::string ending = file_ending(path);
  std::string text;
  if (!names.empty()) {
    text = fmt::format("an {} file has no place for the properties {}; a .ply keeps them", ending, names);
    if (bare)
      text = fmt::format("an {} file holds triangles alone, not the properties {}; a .ply keeps them", ending, names);
  }
  if (bare && mesh.double_positions) {
    text += fmt::format("{}its coordinates are floats, too coarse for these: --local subtracts a round shift",
                        text.empty() ? "" : "; ");
  }
  return text.empty() ? text : fmt::format("{}: {}", path, text);
}

}  // namespace

std::optional<MeshFormat> known_mesh_format(std::string_view path) {
  static constexpr std::array<std::pair<std::string_view, MeshFormat>, 5> kEndings{{{".ply", MeshFormat::ply},
                                                                                    {".obj", MeshFormat::obj},
                                                                                    {".off", MeshFormat::off},
                                                                                    {".stl", MeshFormat::stl},
                                                                                    {".glb", MeshFormat::glb}}};
  const std::string ending = file_ending(path);
  for (const auto& [name, format] : kEndings) {
    if (ending == name) return format;
  }
  return std::nullopt;
}

MeshFormat mesh_format(std::string_view path) {
  return known_mesh_format(path).value_or(MeshFormat::ply);
}

void warn_of_losses(const MeshSinkSettings& mesh, const RunContext& run) {
  for (const std::string& path : mesh.paths()) {
    if (const std::string losses = describe_losses(mesh, path); !losses.empty()) run.warn(losses);
  }
}

namespace {

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

/// True when every position survives a round trip through float.
bool holds_floats(const TriangleMesh& mesh) {
  return std::all_of(mesh.positions.begin(), mesh.positions.end(), [](const auto& p) {
    return std::all_of(p.begin(), p.end(),
                       [](double c) { return std::isnan(c) || static_cast<double>(static_cast<float>(c)) == c; });
  });
}

}  // namespace

void write_glb(const TriangleMesh& mesh, const std::string& name, const std::function<void(std::string_view)>& sink) {
  HeldMesh blocks(mesh);
  write_glb(blocks, name, sink);
}

void write_ply(const TriangleMesh& mesh, ResultFile& out) {
  const bool as_float = holds_floats(mesh);
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
  using meshes::MeshFormat;
  const auto format = path == "-" ? MeshFormat::ply : meshes::known_mesh_format(path);
  if (!format) {
    throw Error(ExitCode::usage,
                fmt::format("{}: unknown mesh format to write; known are .ply, .obj, .off, .stl, .glb", path));
  }
  ResultFile out(path);
  if (*format == MeshFormat::ply) {
    meshes::write_ply(mesh, out);
  } else {
    meshes::HeldMesh blocks(mesh);
    meshes::write_blocks(blocks, *format, out);
  }
  out.commit();
}

namespace {

/// A stored mesh without the lines that say where it comes from, as a mesh that was read whole is without them.
class PlainBlocks final : public meshes::MeshBlocks {
 public:
  explicit PlainBlocks(meshes::MeshBlocks& mesh) : mesh_(mesh) {}
  [[nodiscard]] std::uint64_t vertices() const override { return mesh_.vertices(); }
  [[nodiscard]] std::uint64_t triangles() const override { return mesh_.triangles(); }
  [[nodiscard]] bool has_normals() const override { return mesh_.has_normals(); }
  [[nodiscard]] const AttributeLayout& layout() const override { return mesh_.layout(); }
  void read_vertices(std::uint64_t first, std::size_t count, TriangleMesh& out) override {
    mesh_.read_vertices(first, count, out);
  }
  void read_triangles(std::uint64_t first, std::size_t count, std::vector<std::array<std::uint32_t, 3>>& out) override {
    mesh_.read_triangles(first, count, out);
  }

 private:
  meshes::MeshBlocks& mesh_;
};

/// Whether it can be written as it is: what is damaged is for the reader of whole meshes, which says so or drops it.
bool is_sound(meshes::MeshBlocks& mesh) {
  bool sound = true;
  meshes::for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
    const auto& p = block.positions[v];
    sound = sound && std::all_of(p.begin(), p.end(), [](double c) { return std::isfinite(c); });
  });
  const std::uint64_t vertices = mesh.vertices();
  meshes::for_triangles(mesh, [&](const std::array<std::uint32_t, 3>& t) {
    sound = sound && std::all_of(t.begin(), t.end(), [&](std::uint32_t v) { return v < vertices; });
  });
  return sound;
}

}  // namespace

std::optional<ConvertedMesh> convert_mesh_file(const std::string& from, const std::string& to, const RunContext& run) {
  const auto format = to == "-" ? meshes::MeshFormat::ply : meshes::known_mesh_format(to);
  if (!format || *format == meshes::MeshFormat::ply) return std::nullopt;
  const std::optional<meshes::StoredPly> ply = meshes::open_stored_ply(from);
  if (!ply || ply->mesh.triangles == 0) return std::nullopt;
  const std::unique_ptr<meshes::MeshBlocks> stored = stored_blocks(ply->mesh, ply->layout, run);
  PlainBlocks mesh(*stored);
  if (!is_sound(mesh)) return std::nullopt;
  ResultFile out(to);
  meshes::write_blocks(mesh, *format, out);
  out.commit();
  return ConvertedMesh{mesh.vertices(), mesh.triangles()};
}

}  // namespace lamina
