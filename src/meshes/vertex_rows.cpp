#include "meshes/vertex_rows.h"

#include <algorithm>

namespace lamina::meshes {

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
