// Meshes block by block: what writers take, so that a mesh need not be in memory, and passes over them.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/mesh.h"

namespace lamina::meshes {

/// A mesh to be written, block by block: from memory or from a file. Blocks are read in order, some of them again.
class MeshBlocks {
 public:
  MeshBlocks() = default;
  virtual ~MeshBlocks() = default;
  MeshBlocks(const MeshBlocks&) = delete;
  MeshBlocks& operator=(const MeshBlocks&) = delete;

  [[nodiscard]] virtual std::uint64_t vertices() const = 0;
  [[nodiscard]] virtual std::uint64_t triangles() const = 0;
  [[nodiscard]] virtual bool has_normals() const = 0;
  [[nodiscard]] virtual const AttributeLayout& layout() const = 0;
  /// Lines a format with comments begins with.
  [[nodiscard]] virtual std::vector<std::string> comments() const { return {}; }
  /// Positions, normals and attributes of `count` vertices into `out`, whose triangles are not looked at.
  virtual void read_vertices(std::uint64_t first, std::size_t count, TriangleMesh& out) = 0;
  virtual void read_triangles(std::uint64_t first, std::size_t count,
                              std::vector<std::array<std::uint32_t, 3>>& out) = 0;
};

inline constexpr std::size_t kBlockRows = 4096;  ///< vertices or triangles read at once

/// Calls use(block, index in it) for every vertex.
template <class Use>
void for_vertices(MeshBlocks& mesh, const Use& use) {
  TriangleMesh block;
  for (std::uint64_t first = 0; first < mesh.vertices(); first += kBlockRows) {
    const std::size_t n = std::min<std::uint64_t>(kBlockRows, mesh.vertices() - first);
    mesh.read_vertices(first, n, block);
    for (std::size_t v = 0; v < n; ++v) use(block, v);
  }
}

template <class Use>
void for_triangles(MeshBlocks& mesh, const Use& use) {
  std::vector<std::array<std::uint32_t, 3>> block;
  for (std::uint64_t first = 0; first < mesh.triangles(); first += kBlockRows) {
    const std::size_t n = std::min<std::uint64_t>(kBlockRows, mesh.triangles() - first);
    mesh.read_triangles(first, n, block);
    for (const auto& t : block) use(t);
  }
}

/// A mesh in memory, block by block. Refers to the mesh.
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
