#include "lamina/mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/output_file.h"
#include "meshes/mesh_blocks.h"
#include "meshes/mesh_format.h"
#include "meshes/stored_mesh.h"
#include "meshes/writers.h"

namespace lamina {
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
