#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/output_file.h"
#include "lamina/error.h"
#include "meshes/block_passes.h"
#include "meshes/glb_columns.h"
#include "meshes/glb_document.h"
#include "meshes/glb_set.h"
#include "meshes/writers.h"

namespace lamina::meshes {
namespace {

/// A mesh that one buffer holds.
struct WholeGlb {
  GlbPiece piece;
  std::string json;
  std::uint64_t data = 0;
  [[nodiscard]] std::uint64_t bytes() const { return glb_file_bytes(json, data); }
};

std::uint64_t glb_bytes_of(const MeshBlocks& mesh) {
  return glb_data_bytes(mesh.layout(), mesh.has_normals(), mesh.vertices(), mesh.triangles());
}

WholeGlb whole_glb(MeshBlocks& mesh, const std::string& name) {
  WholeGlb whole;
  whole.piece.vertices = mesh.vertices();
  whole.piece.triangles = mesh.triangles();
  if (mesh.vertices() > 0) whole.piece.box = glb_box_of(mesh, name);
  whole.data = mesh.vertices() > 0 ? glb_bytes_of(mesh) : 0;
  whole.json = describe_glb(mesh, {whole.piece});
  return whole;
}

void write_whole(MeshBlocks& mesh, const WholeGlb& whole, const GlbBytes::Sink& sink) {
  GlbBytes bytes(sink);
  bytes.add_head(whole.json, whole.data);
  for (const GlbColumn& column : glb_columns(mesh.layout(), mesh.has_normals(), whole.piece.box)) {
    for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
      std::array<std::byte, kMostGlbColumn> record{};
      column.encode(block, v, record.data());
      bytes.add(record.data(), column.stride);
    });
  }
  if (mesh.vertices() > 0) {
    for_triangles(mesh, [&](const std::array<std::uint32_t, 3>& t) {
      bytes.add(reinterpret_cast<const std::byte*>(t.data()), sizeof t);
    });
  }
  bytes.flush();
}

void require_one_file(std::uint64_t bytes, const std::string& name) {
  if (bytes <= GlbLimits{}.file) return;
  throw Error(
      ExitCode::budget,
      fmt::format("{}: a single GLB holds at most 4 GB, the mesh takes {:.1f} GB in it; write a .ply, or cut the cloud",
                  name, static_cast<double>(bytes) * 1e-9));
}

}  // namespace

std::uint64_t glb_data_bytes(const AttributeLayout& layout, bool normals, std::uint64_t vertices,
                             std::uint64_t triangles) {
  std::uint64_t vertex = 0;
  for (const GlbColumn& column : glb_columns(layout, normals, {})) vertex += column.stride;
  return vertices * vertex + triangles * kGlbTriangleBytes;
}

void write_glb(MeshBlocks& mesh, ResultFile& out, const GlbLimits& limits) {
  for (const std::string& old : companions_of_glb(out.path())) out.replace_companion(old);
  if (glb_bytes_of(mesh) <= limits.file) {
    const WholeGlb whole = whole_glb(mesh, out.name());
    if (whole.bytes() <= limits.file)
      return write_whole(mesh, whole, [&out](std::string_view bytes) { out.write(bytes); });
  }
  write_glb_set(mesh, out, limits);
}

void write_glb(MeshBlocks& mesh, const std::string& name, const std::function<void(std::string_view)>& sink) {
  require_one_file(glb_bytes_of(mesh), name);
  const WholeGlb whole = whole_glb(mesh, name);
  require_one_file(whole.bytes(), name);
  write_whole(mesh, whole, sink);
}

}  // namespace lamina::meshes
