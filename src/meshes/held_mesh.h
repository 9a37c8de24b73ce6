// A mesh in memory, block by block.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/writers.h"

namespace lamina::meshes {

/// Refers to the mesh.
class HeldMesh final : public MeshBlocks {
 public:
  explicit HeldMesh(const TriangleMesh& mesh) : mesh_(mesh) {}
  [[nodiscard]] std::uint64_t vertices() const override { return mesh_.positions.size(); }
  [[nodiscard]] std::uint64_t triangles() const override { return mesh_.triangles.size(); }
  [[nodiscard]] bool has_normals() const override { return !mesh_.normals.empty(); }
  [[nodiscard]] const AttributeLayout& layout() const override { return mesh_.layout; }
  void read_vertices(std::uint64_t first, std::size_t count, TriangleMesh& out) override {
    slice(mesh_.positions, first, count, out.positions);
    slice(mesh_.normals, first, count, out.normals);
    out.attributes.resize(mesh_.attributes.size());
    for (std::size_t a = 0; a < mesh_.attributes.size(); ++a)
      slice(mesh_.attributes[a], first, count, out.attributes[a]);
  }
  void read_triangles(std::uint64_t first, std::size_t count, std::vector<std::array<std::uint32_t, 3>>& out) override {
    slice(mesh_.triangles, first, count, out);
  }

 private:
  template <class T>
  static void slice(const std::vector<T>& from, std::uint64_t first, std::size_t count, std::vector<T>& to) {
    to.clear();
    if (from.empty()) return;
    const auto begin = from.begin() + static_cast<std::ptrdiff_t>(first);
    to.insert(to.end(), begin, begin + static_cast<std::ptrdiff_t>(count));
  }
  const TriangleMesh& mesh_;
};

}  // namespace lamina::meshes
