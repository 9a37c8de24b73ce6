// Some of a mesh's vertices: a bit for each, and their places among each other.
#pragma once
#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lamina::meshes {

class VertexSet {
 public:
  explicit VertexSet(std::uint64_t vertices) : words_(vertices / 64 + 1) {}

  [[nodiscard]] bool has(std::uint64_t vertex) const { return (words_[vertex / 64] >> vertex % 64 & 1) != 0; }
  void insert(std::uint64_t vertex) {
    if (has(vertex)) return;
    words_[vertex / 64] |= std::uint64_t{1} << vertex % 64;
    ++size_;
    if (!(vertex > 0 && has(vertex - 1))) ++runs_;
    if ((vertex + 1) / 64 < words_.size() && has(vertex + 1)) --runs_;
  }
  void clear() {
    words_.assign(words_.size(), 0);
    size_ = runs_ = 0;
  }

  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] std::uint64_t runs() const { return runs_; }  ///< of vertices that follow each other

  /// Everything is in it: place_of() may be asked.
  void number() {
    before_.clear();
    std::uint32_t before = 0;
    for (std::size_t word = 0; word < words_.size(); ++word) {
      if (word % kGroup == 0) before_.push_back(before);
      before += static_cast<std::uint32_t>(std::popcount(words_[word]));
    }
  }
  /// How many of those before this one are in it.
  [[nodiscard]] std::uint32_t place_of(std::uint64_t vertex) const {
    const std::size_t word = vertex / 64;
    std::uint32_t place = before_[word / kGroup];
    for (std::size_t w = word / kGroup * kGroup; w < word; ++w)
      place += static_cast<std::uint32_t>(std::popcount(words_[w]));
    return place + static_cast<std::uint32_t>(std::popcount(words_[word] & ((std::uint64_t{1} << vertex % 64) - 1)));
  }
  /// The first one at or behind `from`, `end` where there is none before that.
  [[nodiscard]] std::uint64_t next(std::uint64_t from, std::uint64_t end) const { return find(from, end, 0); }
  /// The first one that is not in it.
  [[nodiscard]] std::uint64_t next_gap(std::uint64_t from, std::uint64_t end) const {
    return find(from, end, ~std::uint64_t{0});
  }

 private:
  static constexpr std::size_t kGroup = 8;

  [[nodiscard]] std::uint64_t find(std::uint64_t from, std::uint64_t end, std::uint64_t inverted) const {
    while (from < end) {
      const std::uint64_t bits = (words_[from / 64] ^ inverted) >> from % 64;
      if (bits != 0) return std::min<std::uint64_t>(end, from + static_cast<std::uint64_t>(std::countr_zero(bits)));
      from = (from / 64 + 1) * 64;
    }
    return end;
  }

  std::vector<std::uint64_t> words_;
  std::vector<std::uint32_t> before_;  ///< vertices before each group of words
  std::uint64_t size_ = 0, runs_ = 0;
};

}  // namespace lamina::meshes
