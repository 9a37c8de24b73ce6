#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/little_endian.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "meshes/colours.h"
#include "meshes/mesh_blocks.h"
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
    for (const Vec3& row : {unit(cross(b - a, c - a)), a, b, c})
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

}  // namespace lamina::meshes
