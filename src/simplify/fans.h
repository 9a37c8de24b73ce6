// Triangles by their vertices, while edges are contracted.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

namespace lamina::simplify {

using Triangle = std::array<std::uint32_t, 3>;

/// Which triangles meet at a vertex, as lists threaded through the triangles' corners.
class Fans {
 public:
  Fans(std::vector<Triangle> triangles, std::size_t vertices);

  [[nodiscard]] const std::vector<Triangle>& triangles() const { return triangles_; }
  [[nodiscard]] bool alive(std::uint32_t triangle) const { return triangles_[triangle][0] != kNone; }
  [[nodiscard]] bool used(std::uint32_t vertex) const { return head_[vertex] != kNone; }
  /// The triangles at `vertex`, into `out`.
  void around(std::uint32_t vertex, std::vector<std::uint32_t>& out) const;
  /// Their other vertices, each once, in ascending order.
  void neighbours(std::uint32_t vertex, std::vector<std::uint32_t>& out) const;
  /// The number of triangles that have both vertices.
  [[nodiscard]] int sides(std::uint32_t u, std::uint32_t v) const;
  /// Is it at an edge of one triangle?
  [[nodiscard]] bool boundary(std::uint32_t vertex) const;
  /// The link condition: contracting the edge changes neither topology nor manifoldness.
  [[nodiscard]] bool contractible(std::uint32_t u, std::uint32_t v);
  /// v becomes u. Returns how many triangles go.
  int contract(std::uint32_t u, std::uint32_t v);

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  std::vector<Triangle> triangles_;  ///< of dead ones the first vertex is kNone
  std::vector<std::uint32_t> head_;  ///< first corner of a vertex
  std::vector<std::uint32_t> next_;  ///< the corner behind a corner
  mutable std::vector<std::uint32_t> scratch_, of_u_, of_v_, common_;
};

}  // namespace lamina::simplify
