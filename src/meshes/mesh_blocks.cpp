#include "meshes/mesh_blocks.h"

#include <algorithm>
#include <span>

namespace lamina::meshes {

TriangleBins::TriangleBins(std::size_t bins, const std::string& tmp_dir)
    : file_(tmp_dir),
      bins_(bins),
      most_held_(std::clamp<std::size_t>((std::size_t{48} << 20) / (sizeof(Corners) * bins_.size()), 32, 2048)) {}

void TriangleBins::spill(Bin& bin) {
  if (bin.held.empty()) return;
  bin.chunks.push_back({file_.append(std::as_bytes(std::span(bin.held))), bin.held.size()});
  bin.held.clear();
}

void TriangleBins::finish() {
  for (Bin& bin : bins_) {
    spill(bin);
    bin.held = {};
  }
  file_.flush();
}

std::vector<TriangleBins::Corners> TriangleBins::read(std::uint32_t bin) const {
  std::size_t all = 0, done = 0;
  for (const Chunk& chunk : bins_[bin].chunks) all += chunk.count;
  std::vector<Corners> corners(all);
  for (const Chunk& chunk : bins_[bin].chunks) {
    file_.read(chunk.offset, std::as_writable_bytes(std::span(corners).subspan(done, chunk.count)));
    done += chunk.count;
  }
  return corners;
}

VertexNumbers::VertexNumbers(std::span<const std::array<std::uint32_t, 3>> triangles) {
  for (const auto& t : triangles) {
    for (const std::uint32_t v : t) {
      if (pages_.empty() || pages_.back() != v / kPage) pages_.push_back(v / kPage);
    }
  }
  std::sort(pages_.begin(), pages_.end());
  pages_.erase(std::unique(pages_.begin(), pages_.end()), pages_.end());
  words_.resize(pages_.size() * kWords);
  for (const auto& t : triangles) {
    for (const std::uint32_t v : t) word_of(v).bits |= std::uint64_t{1} << v % 64;
  }
  std::uint32_t before = 0;
  for (Word& word : words_) {
    word.before = before;
    before += static_cast<std::uint32_t>(std::popcount(word.bits));
  }
}

std::vector<std::uint32_t> VertexNumbers::vertices() const {
  std::vector<std::uint32_t> all;
  for (std::size_t w = 0; w < words_.size(); ++w) {
    const auto first = pages_[w / kWords] * kPage + static_cast<std::uint32_t>(w % kWords) * 64;
    for (std::uint64_t bits = words_[w].bits; bits != 0; bits &= bits - 1)
      all.push_back(first + static_cast<std::uint32_t>(std::countr_zero(bits)));
  }
  return all;
}

VertexNumbers::Word& VertexNumbers::word_of(std::uint32_t vertex) {
  const std::uint32_t page = vertex / kPage;
  if (pages_[last_] != page)
    last_ = static_cast<std::size_t>(std::lower_bound(pages_.begin(), pages_.end(), page) - pages_.begin());
  return words_[last_ * kWords + vertex % kPage / 64];
}

}  // namespace lamina::meshes
