#include "ranks/rank_slabs.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <utility>

#include "boundary/boundary.h"
#include "chunks/part_slabs.h"
#include "meshes/streamed_ply.h"

namespace lamina::ranks {
namespace {

constexpr std::size_t kEncoded = 4096;  ///< vertices encoded at once
/// Read back at once: what is made of it stays in the cache.
constexpr std::size_t kVertexBytes = 256 << 10, kTriangleBytes = 64 << 10;

}  // namespace

RankSlabs::RankSlabs(const SlabSpan& span, MeshSinkSettings layout, const std::string& directory)
    : span_(span), layout_(std::move(layout)), records_(directory), faces_(directory) {}

void RankSlabs::write(const MeshSlab& slab) {
  const VertexBatch& vertices = slab.vertices;
  if (slab.slab < span_.begin) {
    if (slab.slab == span_.begin - 1) {
      below_ = mark_of(vertices, layout_);
      stands_on_ = vertices;
    }
    first_ += vertices.size();
    return;
  }
  if (slab.slab >= span_.end) return;
  if (!begun_) finder_ = boundary::BoundaryFinder(first_, stands_on_);
  begun_ = true;
  require_writable(vertices, layout_.attributes, layout_.double_positions, vertices_);
  const std::size_t record = vertex_record_bytes(layout_.attributes, layout_.double_positions);
  std::vector<std::byte> bytes(kEncoded * record);
  for (std::size_t done = 0; done < vertices.size(); done += kEncoded) {
    const std::size_t n = std::min(kEncoded, vertices.size() - done);
    encode_vertices(vertices, layout_.attributes, layout_.double_positions, done, n, bytes.data());
    records_.append(std::span(bytes).first(n * record));
  }
  if (slab.slab == span_.end - 1) last_ = mark_of(vertices, layout_);
  make_relative(slab.triangles, first_, below_.vertices, relative_);
  faces_.append(std::as_bytes(std::span(relative_)));
  vertices_ += vertices.size();
  triangles_ += relative_.size();
  boundary_.clear();
  finder_.add(vertices, slab.triangles, boundary_);
  if (!boundary_.empty()) boundary::pack(boundary_, packed_boundary_);
}

std::vector<std::byte> RankSlabs::take_boundary() {
  if (begun_) {
    boundary_.clear();
    finder_.finish(/*more=*/true, boundary_);
    boundary::pack(boundary_, packed_boundary_);
  }
  return std::move(packed_boundary_);
}

void RankSlabs::read_vertices(const std::function<void(std::span<const std::byte>)>& take) {
  records_.flush();
  records_.read_through(kVertexBytes, take);
}

void RankSlabs::read_triangles(const std::function<void(std::span<const PartTriangle>)>& take) {
  std::vector<PartTriangle> triangles;
  const auto unpack = [&](std::span<const std::byte> bytes) {
    triangles.resize(bytes.size() / sizeof(PartTriangle));
    std::memcpy(triangles.data(), bytes.data(), bytes.size());
    take(triangles);
  };
  faces_.flush();
  faces_.read_through(kTriangleBytes / sizeof(PartTriangle) * sizeof(PartTriangle), unpack);
}

}  // namespace lamina::ranks
