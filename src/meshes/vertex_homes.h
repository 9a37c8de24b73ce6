// Which part of space the vertices of a stored mesh lie in.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/block_passes.h"
#include "meshes/vec3.h"

namespace lamina::meshes {

/// Vertices' places as numbers, found as they are asked for and kept a block of vertices at a time: neighbours follow
/// each other in meshes that were streamed. `Find`: the number of a place, std::uint32_t(const Vec3&).
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

}  // namespace lamina::meshes
