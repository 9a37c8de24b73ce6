// Triangles by their vertices, while edges are contracted: what that does to topology and shape.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "meshes/vec3.h"

namespace lamina::simplify {

using Triangle = std::array<std::uint32_t, 3>;

constexpr std::uint32_t kNone = 0xFFFFFFFFU;

// Without branches: which corner it is is chance.

/// The corner that names `vertex`, which is one of them.
inline std::size_t corner_of(const Triangle& t, std::uint32_t vertex) {
  return static_cast<std::size_t>(t[1] == vertex) + 2 * static_cast<std::size_t>(t[2] == vertex);
}
inline bool names(const Triangle& t, std::uint32_t vertex) {
  return (static_cast<unsigned>(t[0] == vertex) | static_cast<unsigned>(t[1] == vertex) |
          static_cast<unsigned>(t[2] == vertex)) != 0;
}

/// A triangle's side from corner k to the next is the (3 number + k)th. The same side of another one of `around`, the
/// triangles at the side's first vertex, or kNone.
inline std::uint32_t find_twin(std::span<const Triangle> triangles, std::uint32_t side,
                               std::span<const std::uint32_t> around) {
  const Triangle& t = triangles[side / 3];
  const std::uint32_t from = t[side % 3], to = t[(side % 3 + 1) % 3];
  for (const std::uint32_t other : around) {
    const Triangle& o = triangles[other];
    const auto before = static_cast<std::uint32_t>((corner_of(o, from) + 2) % 3);
    if (o[before] == to) return 3 * other + before;
  }
  return kNone;
}

/// Which triangles meet at a vertex: for each a run of triangle numbers in one array. A contracted vertex' run is
/// written anew behind the others.
class Stars {
 public:
  Stars() = default;
  Stars(std::vector<Triangle> triangles, std::size_t vertices) {
    reset(std::move(triangles), vertices);
    find_boundary();
  }
  /// As if made anew, in the memory that is there, but for the boundary, of which set_boundary() tells.
  void reset(std::vector<Triangle> triangles, std::size_t vertices);
  void set_boundary(std::uint32_t vertex) { boundary_[vertex] = 1; }
  /// The triangles, with those that have gone; what is left is for reset().
  std::vector<Triangle> release() { return std::move(triangles_); }

  [[nodiscard]] const std::vector<Triangle>& triangles() const { return triangles_; }
  [[nodiscard]] bool alive(std::uint32_t triangle) const { return triangles_[triangle][0] != kNone; }
  /// The triangles at a vertex; none for one that is gone.
  [[nodiscard]] std::span<const std::uint32_t> around(std::uint32_t vertex) const {
    return {runs_.data() + star_[vertex].begin, star_[vertex].size};
  }
  /// They will be read soon.
  void ask_for(std::uint32_t vertex) const { __builtin_prefetch(runs_.data() + star_[vertex].begin); }
  /// Their other vertices, each once, into `out`.
  void neighbours(std::uint32_t vertex, std::vector<std::uint32_t>& out);
  /// Is it at an edge of one triangle?
  [[nodiscard]] bool boundary(std::uint32_t vertex) const { return boundary_[vertex] != 0; }
  /// The link condition: contracting the edge changes neither topology nor manifoldness.
  [[nodiscard]] bool contractible(std::uint32_t u, std::uint32_t v);
  /// v becomes u. Returns how many triangles go.
  int contract(std::uint32_t u, std::uint32_t v);
  /// What contracting the edge changes, to be put back by revert().
  struct Before;
  [[nodiscard]] Before before(std::uint32_t u, std::uint32_t v) const;
  /// The triangles of both, those of either twice.
  template <class Use>
  void for_touched(const Before& before, const Use& use) const;
  /// Takes a contraction back, of which every triangle is as it left it. Returns how many triangles there are more.
  int revert(std::uint32_t u, std::uint32_t v, const Before& before);
  /// Triangles that have gone leave the arrays, and the others get other numbers in the same order.
  void tidy();

 private:
  struct Run {
    std::uint32_t begin = 0, size = 0;
  };
  void list_triangles();
  void find_boundary();
  [[nodiscard]] bool inner_contractible(std::uint32_t u, std::uint32_t v);
  void drop(std::uint32_t vertex, std::uint32_t triangle);

  std::vector<Triangle> triangles_;  ///< of dead ones the first vertex is kNone
  std::vector<Run> star_;
  std::vector<std::uint32_t> runs_;
  std::vector<std::uint8_t> boundary_;
  std::vector<std::uint32_t> mark_;  ///< of vertices: the last question that met them
  std::uint32_t question_ = 0;
};

struct Stars::Before {
  Run u, v;
  std::uint8_t boundary = 0;  ///< of u
  std::uint8_t dead = 0;
  std::array<std::uint32_t, 2> triangle{}, first{};  ///< those that go, and their first vertices
};

template <class Use>
void Stars::for_touched(const Before& before, const Use& use) const {
  for (const Run& run : {before.u, before.v}) {
    for (std::uint32_t i = run.begin; i < run.begin + run.size; ++i) use(runs_[i]);
  }
}

constexpr double kSliver = 0.05;  ///< no contraction makes triangles worse than this (1: equilateral)

/// Triangles of which one corner moves: does each keep its side, and a quality of at least `sliver` where it had it?
/// Four at a time, in floats, in lengths of the edge from a to b.
class Moves {
 public:
  Moves(const meshes::Vec3& to, const meshes::Vec3& a, const meshes::Vec3& b, double sliver);

  /// One with corners p and q, whose third moves from `from` to the place of all; `counts`: or none, told without a
  /// branch. False: no other need be added.
  bool add(const meshes::Vec3& from, const meshes::Vec3& p, const meshes::Vec3& q, bool counts) {
    put(from, 0);
    put(p, 1);
    put(q, 2);
    size_ += static_cast<std::size_t>(counts);
    return size_ < kRoom || allowed();
  }
  /// Those that were added since this was asked.
  [[nodiscard]] bool allowed();

 private:
  static constexpr std::size_t kRoom = 16;  ///< of most edges all that stay
  using Axis = std::array<float, kRoom>;

  void put(const meshes::Vec3& at, std::size_t corner) {
    for (std::size_t k = 0; k < 3; ++k) corners_[corner][k][size_] = static_cast<float>(scale_ * (at[k] - to_[k]));
  }

  meshes::Vec3 to_;
  double scale_;
  float sliver2_;
  std::size_t size_ = 0;
  std::array<std::array<Axis, 3>, 3> corners_;  ///< where the third was, and the others
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
      const std::size_t k = corner_of(t, vertex);
      if (!moves.add(from, place(t[(k + 1) % 3]), place(t[(k + 2) % 3]), !names(t, other))) return false;
    }
  }
  return moves.allowed();
}

}  // namespace lamina::simplify
