// The vertices of some of a mesh's triangles: numbered anew, and their rows read where they lie.
#pragma once
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/block_passes.h"

namespace lamina::meshes {

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
