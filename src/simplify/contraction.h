// What contracting one edge does to a mesh: where the new vertex goes, what it costs, what becomes of the triangles.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "meshes/vec3.h"
#include "simplify/quadric.h"
#include "simplify/stars.h"

namespace lamina::simplify {

struct Placed {
  meshes::Vec3 at;
  double cost;  ///< at least 0
};

/// Where the edge from a to b goes, of which `sum` is the quadric of both ends: where that is least, or, where this is
/// nowhere or far off, to an end or the middle.
Placed place_edge(const Quadric& sum, const meshes::Vec3& a, const meshes::Vec3& b);

constexpr double kSliver = 0.05;  ///< no contraction makes triangles worse than this (1: equilateral)

/// Triangles of which one corner moves: does each keep its side, and a quality of at least `sliver` where it had it?
/// Four at a time, in floats, in lengths of the edge from a to b.
class Moves {
 public:
  static constexpr std::size_t kLanes = 4;
  using Lanes = float __attribute__((vector_size(4 * kLanes)));
  using Triple = std::array<Lanes, 3>;

  Moves(const meshes::Vec3& to, const meshes::Vec3& a, const meshes::Vec3& b, double sliver);

  /// One with corners p and q, whose third moves from `from` to the place of all. False: no other need be added.
  bool add(const meshes::Vec3& from, const meshes::Vec3& p, const meshes::Vec3& q) {
    put(from, 0);
    put(p, 1);
    put(q, 2);
    return ++size_ < kLanes || keep();
  }
  /// All are there.
  [[nodiscard]] bool allowed() {
    if (size_ == 0) return true;
    for (std::size_t lane = size_; lane < kLanes; ++lane) {
      for (auto& corner : corners_) {
        for (Lanes& axis : corner) axis[lane] = axis[0];
      }
    }
    return keep();
  }

 private:
  void put(const meshes::Vec3& at, std::size_t corner) {
    for (std::size_t k = 0; k < 3; ++k) corners_[corner][k][size_] = static_cast<float>(scale_ * (at[k] - to_[k]));
  }
  bool keep();

  meshes::Vec3 to_;
  double scale_;
  float sliver2_;
  std::size_t size_ = 0;
  std::array<Triple, 3> corners_{};  ///< where the third was, and the others
};

/// Do the triangles that stay allow that u and v become one vertex at `to`? `place(vertex)`: where it is.
template <class Place>
bool keeps_shape(const Stars& stars, const Place& place, std::uint32_t u, std::uint32_t v, const meshes::Vec3& to,
                 double sliver = kSliver) {
  Moves moves(to, place(u), place(v), sliver);
  for (const auto& [vertex, other] : {std::pair{u, v}, std::pair{v, u}}) {
    const meshes::Vec3& from = place(vertex);
    for (const std::uint32_t triangle : stars.around(vertex)) {
      const Triangle& t = stars.triangles()[triangle];
      if (names(t, other)) continue;
      const std::size_t k = corner_of(t, vertex);
      if (!moves.add(from, place(t[(k + 1) % 3]), place(t[(k + 2) % 3]))) return false;
    }
  }
  return moves.allowed();
}

/// How far along the edge from a to b a place is: 0 at a, 1 at b.
double share_along(const meshes::Vec3& a, const meshes::Vec3& b, const meshes::Vec3& place);

}  // namespace lamina::simplify
