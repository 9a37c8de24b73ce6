// Whether a convex polygon lies near triangles.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "meshes/vec3.h"

namespace lamina::simplify {

/// A triangle that others may lie near.
struct alignas(64) Facet {
  /// Its plane and those through its sides as x, y, z and what is added, four of each, for points less the origin.
  std::array<std::array<float, 4>, 4> planes{};
  double error = 0;  ///< what lying on it costs already
  std::uint32_t id = 0;
  std::array<meshes::Vec3, 3> corners{};
  meshes::Vec3 normal{};                  ///< of length one; 0 where the triangle has no area
  std::array<meshes::Vec3, 3> along{};    ///< sides, of length one
  std::array<meshes::Vec3, 3> outward{};  ///< of the sides, in the plane, of length one
  std::array<double, 3> length{};
};
Facet make_facet(const meshes::Vec3& a, const meshes::Vec3& b, const meshes::Vec3& c, const meshes::Vec3& origin);

/// The distance of a point where it is at most `most`, else infinite.
inline double distance_within(const meshes::Vec3& x, const Facet& f, double most) {
  using namespace meshes;
  constexpr double kFar = std::numeric_limits<double>::infinity();
  const double height = dot(f.normal, x - f.corners[0]);
  if (std::abs(height) > most) return kFar;
  std::array<double, 3> beyond{};
  for (std::size_t k = 0; k < 3; ++k) {
    beyond[k] = dot(f.outward[k], x - f.corners[k]);
    if (beyond[k] > most) return kFar;
  }
  const bool area = dot(f.normal, f.normal) > 0.5;
  if (area && beyond[0] <= 0 && beyond[1] <= 0 && beyond[2] <= 0) return std::abs(height);
  double nearest2 = kFar;
  for (std::size_t k = 0; k < 3; ++k) {
    if (area && beyond[k] <= 0) continue;
    const Vec3 w = x - f.corners[k];
    const Vec3 off = w - std::clamp(dot(f.along[k], w), 0.0, f.length[k]) * f.along[k];
    nearest2 = std::min(nearest2, dot(off, off));
  }
  return most >= 0 && nearest2 <= most * most ? std::sqrt(nearest2) : kFar;
}

/// Proves that every point of a triangle is so near to one of some facets that distance and error are within a bound.
/// The distance to a triangle, a convex set, is a convex function, greatest over a polygon at one of its corners: a
/// polygon whose corners are all near one facet is near it altogether. One that is not is cut along a side of a facet
/// that is near one of its corners, and both parts have to be proved. What is not proved may be true all the same.
class Cover {
 public:
  /// `origin`: that of the facets; all of them and of what is asked lies within `size` of it.
  Cover(double bound, const meshes::Vec3& origin, double size)
      : bound_(bound), origin_(origin), rounding_(kRounding * static_cast<float>(size)) {}
  /// `error`: the triangle's own, which adds to the facets'. Polygons are cut at most `cuts` times in all.
  bool prove(const std::array<meshes::Vec3, 3>& triangle, double error, std::span<const Facet* const> facets, int cuts);

  /// Of the last proof: the greatest sum of distance and errors, and the facets it took, by their ids.
  [[nodiscard]] double error() const { return error_; }
  [[nodiscard]] std::span<const std::uint32_t> used() const { return used_; }

 private:
  static constexpr float kRounding = 4e-6F;       ///< of all lengths: what floats may be wrong by
  static constexpr std::size_t kMostFacets = 64;  ///< others are not asked
  static constexpr std::size_t kMostCorners = 12;
  struct Corner {
    meshes::Vec3 at;
    std::array<float, 3> local;               ///< less the origin
    std::uint64_t near = 0;                   ///< a bit for each facet
    std::array<float, kMostFacets> distance;  ///< to those that are near, their errors added
  };
  struct Polygon {
    std::array<std::uint16_t, kMostCorners> corners{};
    std::size_t size = 0;
  };
  struct Cut {
    meshes::Vec3 normal;
    double offset;
  };
  enum class Answer { near, far, open };
  Answer ask_at_once(const std::array<meshes::Vec3, 3>& triangle);
  bool add_corner(std::size_t from, std::size_t to, double share);
  void ask(std::size_t facet, Corner& corner) const;
  bool take(const Polygon& polygon);
  bool choose_cut(const Polygon& polygon, std::size_t first, Cut& cut) const;
  bool halve(const Polygon& polygon, Cut& cut) const;
  bool split(const Polygon& polygon, const Cut& cut);
  void use(std::size_t facet, float error);

  std::span<const Facet* const> facets_;
  std::vector<Corner> corners_;  ///< those of polygons are the first `held_`
  std::size_t held_ = 0;
  std::vector<Polygon> open_;
  std::vector<std::uint32_t> used_;
  double bound_;
  meshes::Vec3 origin_;
  float rounding_;
  double slack_ = 0;  ///< slack: the bound less the triangle's own error
  float reach_ = 0;   ///< slack in floats, a little more
  float good_ = 0;    ///< of distances: no nearer facet is looked for
  double error_ = 0;
};

}  // namespace lamina::simplify
