#include "ranks/rank_slabs.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "boundary/rim_bytes.h"
#include "chunks/part_slabs.h"
#include "lamina/error.h"
#include "meshes/records.h"

namespace lamina::ranks {
namespace {

constexpr std::size_t kBufferBytes = 1 << 20;
constexpr std::size_t kEncoded = 4096;  ///< vertices encoded at once
/// Read back at once: what is made of it stays in the cache.
constexpr std::size_t kVertexBytes = 256 << 10, kTriangleBytes = 64 << 10;

}  // namespace

RankSlabs::RankSlabs(const SlabSpan& span, MeshSinkSettings layout, const std::string& directory)
    : span_(span), layout_(std::move(layout)), directory_(directory) {
  for (Spill* spill : {&records_, &faces_}) spill->file = open_unlinked(directory_);
}

void RankSlabs::write(const FinalSlab& slab, const VertexBatch& vertices) {
  if (slab.slab < span_.begin) {
    if (slab.slab == span_.begin - 1) {
      below_ = mark_of(vertices, layout_);
      stands_on_ = vertices;
    }
    first_ += vertices.size();
    return;
  }
  if (slab.slab >= span_.end) return;
  if (!begun_) finder_ = holes::RimFinder(first_, stands_on_);
  begun_ = true;
  require_writable(vertices, layout_.attributes, layout_.double_positions, vertices_);
  const std::size_t record = vertex_record_bytes(layout_.attributes, layout_.double_positions);
  std::vector<std::byte> bytes(kEncoded * record);
  for (std::size_t done = 0; done < vertices.size(); done += kEncoded) {
    const std::size_t n = std::min(kEncoded, vertices.size() - done);
    encode_vertices(vertices, layout_.attributes, layout_.double_positions, done, n, bytes.data());
    put(records_, std::span(bytes).first(n * record));
  }
  if (slab.slab == span_.end - 1) last_ = mark_of(vertices, layout_);
  make_relative(slab.triangles, first_, below_.vertices, relative_);
  put(faces_, std::as_bytes(std::span(relative_)));
  vertices_ += vertices.size();
  triangles_ += relative_.size();
  piece_.clear();
  finder_.add(vertices, slab.triangles, piece_);
  if (!piece_.empty()) holes::pack(piece_, rims_);
}

std::vector<std::byte> RankSlabs::take_rims() {
  if (begun_) {
    piece_.clear();
    finder_.finish(/*more=*/true, piece_);
    holes::pack(piece_, rims_);
  }
  return std::move(rims_);
}

void RankSlabs::put(Spill& spill, std::span<const std::byte> bytes) {
  spill.waiting.insert(spill.waiting.end(), bytes.begin(), bytes.end());
  spill.bytes += bytes.size();
  if (spill.waiting.size() >= kBufferBytes) flush(spill);
}

void RankSlabs::flush(Spill& spill) {
  if (const int error = write_all(spill.file.get(), spill.waiting.data(), spill.waiting.size()); error != 0) {
    throw Error(ExitCode::budget,
                fmt::format("the temporary file in '{}' cannot grow beyond {} bytes: {}; free space there or choose "
                            "another with --tmp-dir",
                            directory_, spill.bytes - spill.waiting.size(), system_message(error)));
  }
  spill.waiting.clear();
}

void RankSlabs::read(Spill& spill, const std::function<void(std::span<const std::byte>)>& take, std::size_t piece) {
  flush(spill);
  std::vector<std::byte> buffer(piece);
  for (std::uint64_t done = 0; done < spill.bytes;) {
    const std::size_t n = std::min<std::uint64_t>(piece, spill.bytes - done);
    const ReadResult got = pread_all(spill.file.get(), buffer.data(), n, done);
    if (got.error != 0 || got.bytes < n) {
      throw Error(ExitCode::budget,
                  fmt::format("the temporary file in '{}' cannot be read back at byte {}: {}; choose another with "
                              "--tmp-dir",
                              directory_, done, got.error != 0 ? system_message(got.error) : "it ends there"));
    }
    take(std::span(buffer).first(n));
    done += n;
  }
}

void RankSlabs::read_vertices(const std::function<void(std::span<const std::byte>)>& take) {
  read(records_, take, kVertexBytes);
}

void RankSlabs::read_triangles(const std::function<void(std::span<const PartTriangle>)>& take) {
  std::vector<PartTriangle> triangles;
  const auto unpack = [&](std::span<const std::byte> bytes) {
    triangles.resize(bytes.size() / sizeof(PartTriangle));
    std::memcpy(triangles.data(), bytes.data(), bytes.size());
    take(triangles);
  };
  read(faces_, unpack, kTriangleBytes / sizeof(PartTriangle) * sizeof(PartTriangle));
}

}  // namespace lamina::ranks
