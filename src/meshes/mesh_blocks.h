// Meshes block by block: what writers take, so that a mesh need not be in memory, and passes over them; pieces of such
// a mesh, those of a region or a tile: triangles sorted into bins on disk, and their vertices.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/spill_file.h"
#include "lamina/mesh.h"
#include "meshes/vec3.h"

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

/// The bin of a triangle, whose corners lie in these: the one with most of them, else the first.
inline std::uint32_t bin_of_triangle(const std::array<std::uint32_t, 3>& homes) {
  if (homes[0] == homes[1] || homes[0] == homes[2]) return homes[0];
  if (homes[1] == homes[2]) return homes[1];
  return std::min({homes[0], homes[1], homes[2]});
}

/// With a buffer in memory for each bin, 48 MB in all or less, and a temporary file.
class TriangleBins {
 public:
  using Corners = std::array<std::uint32_t, 3>;

  TriangleBins(std::size_t bins, const std::string& tmp_dir);
  /// Throws Error(budget) for a full disk, as finish() does.
  void add(std::uint32_t bin, const Corners& corners) {
    Bin& to = bins_[bin];
    to.held.push_back(corners);
    if (to.held.size() >= most_held_) spill(to);
  }
  /// All are there.
  void finish();
  /// In the order in which they came; after finish(). Safe from several threads. Throws Error(budget) when they cannot
  /// be read.
  [[nodiscard]] std::vector<Corners> read(std::uint32_t bin) const;

 private:
  struct Chunk {
    std::uint64_t offset;
    std::size_t count;
  };
  struct Bin {
    std::vector<Corners> held;
    std::vector<Chunk> chunks;
  };
  void spill(Bin& bin);

  SpillFile file_;
  std::vector<Bin> bins_;
  std::size_t most_held_;
};

/// Which part of space the vertices of a stored mesh lie in: their places as numbers, found as they are asked for and
/// kept a block of vertices at a time: neighbours follow each other in meshes that were streamed. `Find`: the number of
/// a place, std::uint32_t(const Vec3&).
template <typename Find>
class VertexHomes {
 public:
  VertexHomes(MeshBlocks& mesh, Find find)
      : mesh_(mesh), find_(std::move(find)), blocks_((mesh.vertices() + kBlockRows - 1) / kBlockRows) {}

  std::uint32_t of(std::uint32_t vertex) {
    const Block& block = blocks_[vertex / kBlockRows];
    return (block ? block : load(vertex / kBlockRows))[vertex % kBlockRows];
  }

 private:
  using Block = std::unique_ptr<std::uint32_t[]>;

  const Block& load(std::size_t number) {
    constexpr std::size_t kMostBlocks = 4096;  // 64 MB
    if (loaded_.size() == kMostBlocks) {
      blocks_[loaded_.front()].reset();
      loaded_.pop_front();
    }
    const std::uint64_t first = std::uint64_t{number} * kBlockRows;
    const std::size_t count = std::min<std::uint64_t>(kBlockRows, mesh_.vertices() - first);
    mesh_.read_vertices(first, count, rows_);
    blocks_[number] = std::make_unique<std::uint32_t[]>(kBlockRows);
    for (std::size_t v = 0; v < count; ++v) blocks_[number][v] = find_(rows_.positions[v]);
    loaded_.push_back(number);
    return blocks_[number];
  }

  MeshBlocks& mesh_;
  Find find_;
  std::vector<Block> blocks_;
  std::deque<std::size_t> loaded_;
  TriangleMesh rows_;
};

// The vertices of some of a mesh's triangles: numbered anew, and their rows read where they lie.

/// The vertices of some triangles, numbered in ascending order: a bit for each in the pages that have any. Those of a
/// leaf lie in few pages of a streamed mesh; but what closes its holes comes at the very end.
class VertexNumbers {
 public:
  explicit VertexNumbers(std::span<const std::array<std::uint32_t, 3>> triangles);

  /// Of one that is in a triangle.
  [[nodiscard]] std::uint32_t of(std::uint32_t vertex) {
    const Word& word = word_of(vertex);
    const std::uint64_t below = (std::uint64_t{1} << vertex % 64) - 1;
    return word.before + static_cast<std::uint32_t>(std::popcount(word.bits & below));
  }
  [[nodiscard]] std::vector<std::uint32_t> vertices() const;

 private:
  static constexpr std::uint32_t kPage = 4096;  ///< vertices
  static constexpr std::size_t kWords = kPage / 64;
  struct Word {
    std::uint64_t bits = 0;
    std::uint32_t before = 0;  ///< vertices in the words before it
  };
  Word& word_of(std::uint32_t vertex);

  std::vector<std::uint32_t> pages_;  ///< ascending
  std::vector<Word> words_;           ///< of all pages
  std::size_t last_ = 0;              ///< page that was asked for
};

/// Calls use(rows, row) for each vertex of ascending numbers; read(first, count, rows) reads the rows of some that
/// follow each other.
template <class Read, class Use>
void for_vertex_rows(std::span<const std::uint32_t> ids, const Read& read, const Use& use) {
  constexpr std::uint32_t kWorthReading = 64;  // rows between two that are wanted
  TriangleMesh rows;
  for (std::size_t begin = 0; begin < ids.size();) {
    std::size_t end = begin + 1;
    while (end < ids.size() && ids[end] - ids[end - 1] <= kWorthReading && ids[end] - ids[begin] < kBlockRows) ++end;
    read(ids[begin], ids[end - 1] - ids[begin] + 1, rows);
    for (std::size_t i = begin; i < end; ++i) use(rows, ids[i] - ids[begin]);
    begin = end;
  }
}

}  // namespace lamina::meshes
