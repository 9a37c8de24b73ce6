// Whether a triangle lies near a mesh, by looking straight down on it: the quick proof of nearly all triangles.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "meshes/vec3.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// Proves that every point of a triangle is so near to a mesh, along the triangle's normal, that distance and error are
/// within a bound. From a triangle of the mesh on, it visits those that share an edge that is seen over the triangle,
/// all of which have to face its way. Then no end of what was visited is seen there, the visited triangles are as many
/// everywhere over the triangle, and that is at least one where a corner has been found under one of them. The height
/// over the triangle is linear on each of them, greatest where an edge begins, ends or comes into sight, or over a
/// corner.
class Overlay {
 public:
  /// Likely: not near along the normal, but from the planes of the triangles there. Far: neither. Unclear: the mesh
  /// ends there, or turns away.
  enum class Answer { near, likely, far, unclear };

  /// `triangles`: how many the mesh has.
  explicit Overlay(std::size_t triangles) : visited_(triangles, 0) {}

  /// Sides are numbered by triangles: the one from corner k to the next is the (3 number + k)th. `mesh` has
  /// position(vertex), triangle(number), twin(side): the same side of the other triangle there, or kNone;
  /// error(number), which adds to the distance, and needs(number), which is no less and does so where it is asked
  /// whether this is too much. `begin`: a triangle not far away. `most`: of distance and error.
  template <class Mesh>
  Answer prove(const std::array<meshes::Vec3, 3>& triangle, const Mesh& mesh, std::uint32_t begin, double most) {
    begin_ = begin;
    used_.clear();
    if (!look_at(triangle) || !find_first(mesh)) return Answer::unclear;
    most_ = most;
    error_ = 0;
    corners_found_ = 0;
    ++proof_;
    answer_ = Answer::near;
    open_.clear();
    seen_.assign(first_.begin(), first_.end());
    visit(mesh, begin_, first_);
    for (std::uint32_t k = 0; k < 3; ++k) offer(3 * begin_ + k, k, (k + 1) % 3);
    while (going_on() && !open_.empty()) cross(mesh);
    return going_on() && corners_found_ != 7 ? Answer::unclear : answer_;
  }

  /// Of the last proof: the greatest sum of distance and error, and the triangles it took.
  [[nodiscard]] double error() const { return error_; }
  [[nodiscard]] std::span<const std::uint32_t> used() const { return used_; }
  /// One near the triangle's middle, where it was found, else one that is nearer than `begin`.
  [[nodiscard]] std::uint32_t begin() const { return begin_; }

 private:
  static constexpr int kSteps = 64;           ///< to the first triangle that is over the middle
  static constexpr double kTouching = 1e-12;  ///< in sizes of the triangle: no farther over it is not over it
  static constexpr double kOnSide = 1e-9;     ///< in sizes of the other: so far out of it a corner is still under it

  /// A place seen from the triangle: shares of its corners (barycentric coordinates) and the height over it.
  struct Seen {
    double first, second, third, height;
    unsigned outside;  ///< a bit for each share that is no more than kTouching: of which sides it is not inside
  };
  using Corners = std::array<Seen, 3>;
  /// Of a visited triangle: a part of it is over the triangle.
  struct Open {
    std::uint32_t side, from, to;  ///< from and to: in seen_
    double height;                 ///< the greatest
  };

  [[nodiscard]] bool going_on() const { return answer_ == Answer::near || answer_ == Answer::likely; }

  /// False where the triangle has no area.
  bool look_at(const std::array<meshes::Vec3, 3>& triangle) {
    using namespace meshes;
    origin_ = triangle[0];
    const Vec3 u = triangle[1] - triangle[0], v = triangle[2] - triangle[0], n = meshes::cross(u, v);
    const double area2 = dot(n, n);
    if (!(area2 > 0)) return false;
    const double scale = 1 / area2;
    normal_ = std::sqrt(scale) * n;
    second_ = scale * meshes::cross(v, n);
    third_ = scale * meshes::cross(n, u);
    return std::isfinite(scale);
  }

  [[nodiscard]] Seen see(const meshes::Vec3& at) const {
    const meshes::Vec3 from = meshes::operator-(at, origin_);
    const double second = meshes::dot(second_, from), third = meshes::dot(third_, from);
    const double first = 1 - second - third;
    const auto bit = [](double share, unsigned k) { return static_cast<unsigned>(share <= kTouching) << k; };
    return {first, second, third, meshes::dot(normal_, from), bit(first, 0) | bit(second, 1) | bit(third, 2)};
  }

  /// Of a triangle seen from above, in areas of the one that is proved; below 0 where it faces the other way.
  static double area(const Seen& a, const Seen& b, const Seen& c) {
    return (b.second - a.second) * (c.third - a.third) - (b.third - a.third) * (c.second - a.second);
  }

  /// Towards the middle of the triangle.
  template <class Mesh>
  bool find_first(const Mesh& mesh) {
    constexpr Seen kMiddle{1. / 3, 1. / 3, 1. / 3, 0, 0};
    const Triangle& t = mesh.triangle(begin_);
    for (std::size_t k = 0; k < 3; ++k) first_[k] = see(mesh.position(t[k]));
    for (int step = 0; step < kSteps; ++step) {
      std::uint32_t leave = 3;
      double least = 0;
      for (std::uint32_t k = 0; k < 3; ++k) {
        const double inside = area(first_[k], first_[(k + 1) % 3], kMiddle);
        if (inside >= least) continue;
        least = inside;
        leave = k;
      }
      if (leave == 3) return true;
      const std::uint32_t next = mesh.twin(3 * begin_ + leave);
      if (next == kNone) return false;
      begin_ = next / 3;
      const Seen from = first_[(leave + 1) % 3], to = first_[leave];
      const std::uint32_t k = next % 3;
      first_[k] = from;
      first_[(k + 1) % 3] = to;
      first_[(k + 2) % 3] = see(mesh.position(mesh.triangle(begin_)[(k + 2) % 3]));
    }
    return false;
  }

  /// Takes a triangle in; corners of the one that is proved may be under it.
  template <class Mesh>
  void visit(const Mesh& mesh, std::uint32_t number, const Corners& at) {
    visited_[number] = proof_;
    used_.push_back(number);
    const double all = area(at[0], at[1], at[2]);
    if (!(all > 0)) {
      answer_ = Answer::unclear;
      return;
    }
    // Twice the areas with the first corner are these cross products; with another they differ by the sides.
    const double least = -kOnSide * all;
    const double of_third = at[0].second * at[1].third - at[0].third * at[1].second;
    const double of_first = at[1].second * at[2].third - at[1].third * at[2].second;
    for (unsigned corner = 0; corner < 3; ++corner) {
      double third = of_third, first = of_first;
      if (corner == 1) {
        third -= at[1].third - at[0].third;
        first -= at[2].third - at[1].third;
      } else if (corner == 2) {
        third += at[1].second - at[0].second;
        first += at[2].second - at[1].second;
      }
      const double second = all - third - first;
      if (std::min({first, second, third}) < least) continue;
      note(mesh, number, std::abs(first * at[0].height + second * at[1].height + third * at[2].height) / all);
      corners_found_ |= 1U << corner;
    }
  }

  /// A triangle of the mesh is so high over the one that is proved.
  template <class Mesh>
  void note(const Mesh& mesh, std::uint32_t number, double height) {
    error_ = std::max(error_, height + mesh.error(number));
    if (height + mesh.needs(number) > most_ && going_on()) ask_plane(mesh, number, height);
  }

  template <class Mesh>
  [[gnu::noinline]] void ask_plane(const Mesh& mesh, std::uint32_t number, double height) {
    using namespace meshes;
    const Triangle& t = mesh.triangle(number);
    const Vec3& at = mesh.position(t[0]);
    const Vec3 n = meshes::cross(mesh.position(t[1]) - at, mesh.position(t[2]) - at);
    const double from_plane = height * std::abs(dot(normal_, unit(n)));
    answer_ = from_plane + mesh.needs(number) > most_ ? Answer::far : Answer::likely;
  }

  /// Where a part of a side is over the triangle what is beyond has to be seen.
  void offer(std::uint32_t side, std::uint32_t from_seen, std::uint32_t to_seen) {
    const Seen &from = seen_[from_seen], &to = seen_[to_seen];
    if ((from.outside & to.outside) != 0) return;
    double begin = 0, end = 1;
    if (const unsigned cut = from.outside | to.outside; cut != 0) {
      const auto clip = [&](unsigned k, double a, double b) {
        if ((cut >> k & 1U) == 0) return;
        a -= kTouching;
        b -= kTouching;
        double& limit = a < b ? begin : end;
        limit = a < b ? std::max(begin, a / (a - b)) : std::min(end, a / (a - b));
      };
      clip(0, from.first, to.first);
      clip(1, from.second, to.second);
      clip(2, from.third, to.third);
      if (begin >= end) return;
    }
    const double rise = to.height - from.height;
    open_.push_back(
        {side, from_seen, to_seen, std::max(std::abs(from.height + begin * rise), std::abs(from.height + end * rise))});
  }

  template <class Mesh>
  void cross(const Mesh& mesh) {
    const Open open = open_.back();
    open_.pop_back();
    note(mesh, open.side / 3, open.height);
    const std::uint32_t twin = mesh.twin(open.side), beyond = twin / 3, k = twin % 3;
    if (twin == kNone) {
      answer_ = Answer::unclear;
    } else if (visited_[beyond] == proof_) {
      note(mesh, beyond, open.height);
    } else {
      const auto top = static_cast<std::uint32_t>(seen_.size());
      seen_.push_back(see(mesh.position(mesh.triangle(beyond)[(k + 2) % 3])));
      visit(mesh, beyond, {seen_[open.to], seen_[open.from], seen_[top]});
      note(mesh, beyond, open.height);
      if (!going_on()) return;
      offer(3 * beyond + (k + 1) % 3, open.from, top);
      offer(3 * beyond + (k + 2) % 3, top, open.to);
    }
  }

  meshes::Vec3 origin_{}, normal_{}, second_{}, third_{};  ///< what see() needs of the triangle
  double most_ = 0, error_ = 0;
  Answer answer_ = Answer::unclear;
  std::uint32_t begin_ = 0;
  unsigned corners_found_ = 0;  ///< a bit for each
  Corners first_{};
  std::vector<Seen> seen_;  ///< vertices that were seen
  std::vector<Open> open_;
  std::vector<std::uint32_t> used_;
  std::vector<std::uint32_t> visited_;  ///< of the mesh's triangles: the last proof that took them
  std::uint32_t proof_ = 0;
};

}  // namespace lamina::simplify
