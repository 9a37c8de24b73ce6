#include "normals/grid_faces.h"

#include <Eigen/Geometry>
#include <cmath>
#include <utility>

namespace lamina::normals {
namespace {

constexpr std::size_t kEnough = 3;   ///< of the four faces around a sample
constexpr double kGrazing = 0.17;    ///< cosine of 80 degrees
constexpr double kNearPlane = 0.5;   ///< of a face of the second ring: its slope out of the first ring's plane
constexpr double kSameFacing = 0.5;  ///< cosine between the two

}  // namespace

GridFaces::Face GridFaces::face(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) const {
  Face f;
  f.centre = (a + b + c) / 3;
  f.normal = (b - a).cross(c - a);
  const Eigen::Vector3d at(scanner_.at[0], scanner_.at[1], scanner_.at[2]);
  const Eigen::Vector3d sight = scanner_.direction ? at : Eigen::Vector3d(at - f.centre);
  const double cosine = f.normal.dot(sight) / (f.normal.norm() * sight.norm());
  // Not-a-number, of missing samples or of no area, is not more.
  if (!(std::abs(cosine) > kGrazing)) return {};
  if (cosine < 0) f.normal = -f.normal;
  return f;
}

GridFaces::Face GridFaces::quad(const GridLine& low, const GridLine& high, std::size_t at) const {
  const std::array corners{low[at], low[at + 1], high[at + 1], high[at]};
  std::size_t missing = 4;
  for (std::size_t k = 0; k < 4; ++k) {
    if (corners[k].allFinite()) continue;
    if (missing != 4) return {};
    missing = k;
  }
  const auto triangle = [&](std::size_t first) {
    return face(corners[first], corners[(first + 1) % 4], corners[(first + 2) % 4]);
  };
  if (missing != 4) return triangle((missing + 1) % 4);
  // Cut along the shorter diagonal; where one half is no face, the other is.
  const std::size_t cut = (corners[0] - corners[2]).squaredNorm() <= (corners[1] - corners[3]).squaredNorm() ? 0 : 1;
  const Face one = triangle(cut);
  const Face other = triangle(cut + 2);
  if (one.normal.isZero() || other.normal.isZero()) return one.normal.isZero() ? other : one;
  return {one.normal + other.normal, 0.5 * (one.centre + other.centre)};
}

void GridFaces::add(GridLine line) {
  if (!lines_.empty()) {
    std::vector<Face> strip(length_ > 0 ? length_ - 1 : 0);
    for (std::size_t at = 0; at < strip.size(); ++at) strip[at] = quad(lines_.back(), line, at);
    strips_.push_back(std::move(strip));
  }
  lines_.push_back(std::move(line));
  if (lines_.size() > 2 * kRing + 1) lines_.pop_front();
  if (strips_.size() > 2 * kRing) strips_.pop_front();
}

std::array<float, 3> GridFaces::normal_at(std::size_t at) const {
  const std::size_t line = lines_.size() - 1 - kRing;
  const Eigen::Vector3d& p = lines_[line][at];
  if (!p.allFinite()) return {};
  // Calls use(face) for those at most `ring` away: strips line - ring ... line + ring - 1, places likewise.
  const auto for_faces = [&](std::size_t ring, const auto& use) {
    for (std::size_t s = line >= ring ? line - ring : 0; s < line + ring && s < strips_.size(); ++s) {
      for (std::size_t f = at >= ring ? at - ring : 0; f < at + ring && f < strips_[s].size(); ++f) {
        if (!strips_[s][f].normal.isZero()) use(strips_[s][f]);
      }
    }
  };
  Eigen::Vector3d sum(0, 0, 0);
  std::size_t faces = 0;
  for_faces(1, [&](const Face& f) {
    sum += f.normal;
    ++faces;
  });
  // At rims faces lie on one side, and curved surfaces seen at a grazing angle lean away there.
  if (faces < kEnough || sum.isZero()) return {};
  const Eigen::Vector3d first = sum.normalized();
  sum.setZero();
  for_faces(kRing, [&](const Face& f) {
    const Eigen::Vector3d way = f.centre - p;
    const bool level = std::abs(way.dot(first)) <= kNearPlane * way.norm();
    if (level && f.normal.dot(first) > kSameFacing * f.normal.norm()) sum += f.normal;
  });
  const Eigen::Vector3d n = sum.isZero() ? first : Eigen::Vector3d(sum.normalized());
  return {static_cast<float>(n.x()), static_cast<float>(n.y()), static_cast<float>(n.z())};
}

std::vector<std::array<float, 3>> GridFaces::finished() const {
  if (lines_.size() <= kRing) return {};
  std::vector<std::array<float, 3>> normals(length_);
  for (std::size_t at = 0; at < length_; ++at) normals[at] = normal_at(at);
  return normals;
}

}  // namespace lamina::normals
