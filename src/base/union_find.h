// Disjoint sets over the numbers 0 .. n-1 (union-find with path compression), plain and with a sign in every member.
#pragma once
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace lamina {

/// The smaller of two roots stays, so that a set's root is its smallest member, whatever the order of the unions.
class UnionFind {
 public:
  UnionFind() = default;
  explicit UnionFind(std::size_t n) { reset(n); }
  /// n sets of one member each. Keeps its memory.
  void reset(std::size_t n) {
    parent_.resize(n);
    std::iota(parent_.begin(), parent_.end(), 0U);
  }
  [[nodiscard]] std::size_t size() const { return parent_.size(); }
  std::uint32_t find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// False when a and b were in one set already.
  bool unite(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    if (a == b) return false;
    if (a > b) std::swap(a, b);
    parent_[b] = a;
    return true;
  }

 private:
  std::vector<std::uint32_t> parent_;
};

/// Disjoint sets whose members have a sign relative to each other. Threads may work on sets that have nothing in
/// common.
class SignedUnionFind {
 public:
  explicit SignedUnionFind(std::size_t n) : parent_(n), sign_(n, 1) { std::iota(parent_.begin(), parent_.end(), 0U); }

  /// The set's root. sign(i) is relative to it until the next unite().
  std::uint32_t find(std::uint32_t i) {
    std::uint32_t root = i;
    std::int8_t to_root = 1;
    while (parent_[root] != root) {
      to_root = static_cast<std::int8_t>(to_root * sign_[root]);
      root = parent_[root];
    }
    while (i != root && parent_[i] != root) {
      const std::uint32_t next = parent_[i];
      const auto rest = static_cast<std::int8_t>(to_root * sign_[i]);
      parent_[i] = root;
      sign_[i] = to_root;
      to_root = rest;
      i = next;
    }
    return root;
  }
  /// Relative to the root find(i) has just returned; 1 for a root.
  [[nodiscard]] std::int8_t sign(std::uint32_t i) const { return sign_[i]; }

  /// Joins the sets of a and b, whose signs then differ where `relative` is -1. The smaller root stays. False when they
  /// were in one set already: then nothing changes.
  bool unite(std::uint32_t a, std::uint32_t b, std::int8_t relative) {
    // So it is mostly, and on the way to a root no branch could be guessed.
    if (parent_[a] == parent_[b]) return false;
    std::uint32_t root_a = find(a);
    std::uint32_t root_b = find(b);
    if (root_a == root_b) return false;
    const auto sign = static_cast<std::int8_t>(relative * sign_[a] * sign_[b]);
    if (root_a > root_b) std::swap(root_a, root_b);
    parent_[root_b] = root_a;
    sign_[root_b] = sign;
    return true;
  }

 private:
  std::vector<std::uint32_t> parent_;
  std::vector<std::int8_t> sign_;  ///< relative to the parent
};

}  // namespace lamina
