#include "samples/consensus_plane.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace lamina {
namespace {

using Vec3f = std::array<float, 3>;

/// Planes are tried through pairs of so many nearest neighbours: half of them, beside an edge, make ten planes of the
/// sample's own side.
constexpr std::size_t kPaired = 10;
constexpr std::size_t kLeastNeighbours = 6;
/// Two neighbours and the sample nearly in line make no plane.
constexpr float kLeastSine = 0.3F;
constexpr int kFits = 2;
constexpr std::size_t kAbreast = 8;  ///< neighbours side by side

float inner(const Vec3f& a, const Vec3f& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// A quadric through the origin: heights over the plane across its normal there.
struct Quadric {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  [[nodiscard]] double distance(const Eigen::Vector3d& p) const { return p.dot(normal) - p.dot(second * p); }
};

/// The quadric of least squares through the neighbours near the given one.
Quadric fitted(const std::vector<Vec3f>& neighbours, float near, const Quadric& from) {
  const Eigen::Vector3d n = from.normal;
  const Eigen::Vector3d u = n.unitOrthogonal();
  const Eigen::Vector3d v = n.cross(u);
  using Row = Eigen::Matrix<double, 5, 1>;
  Eigen::Matrix<double, 5, 5> a = Eigen::Matrix<double, 5, 5>::Zero();
  Row b = Row::Zero();
  for (const Vec3f& p : neighbours) {
    const Eigen::Vector3d q(p[0], p[1], p[2]);
    const double h = from.distance(q) / double{near};
    if (h * h >= 1) continue;
    const double x = q.dot(u);
    const double y = q.dot(v);
    const Row row{x, y, x * x, x * y, y * y};
    const double w = (1 - h * h) * (1 - q.squaredNorm());
    a += w * row * row.transpose();
    b += w * q.dot(n) * row;
  }
  // Where they are few, or on a line, there is no bend.
  a.diagonal() += a.trace() * Row(1e-6, 1e-6, 1e-3, 1e-3, 1e-3);
  const Row f = a.ldlt().solve(b);
  Quadric out;
  out.normal = (n - f(0) * u - f(1) * v).normalized();
  out.second =
      f(2) * u * u.transpose() + 0.5 * f(3) * (u * v.transpose() + v * u.transpose()) + f(4) * v * v.transpose();
  return out;
}

}  // namespace

void ConsensusPlane::lay_out() {
  const std::size_t n = (neighbours.size() + kAbreast - 1) / kAbreast * kAbreast;
  for (auto* v : {&x_, &y_, &z_, &weight_}) v->assign(n, 0.0F);
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    x_[i] = neighbours[i][0];
    y_[i] = neighbours[i][1];
    z_[i] = neighbours[i][2];
    weight_[i] = 1 - inner(neighbours[i], neighbours[i]);
  }
}

float ConsensusPlane::score(const Vec3f& normal) const {
  std::array<float, kAbreast> sum{};
  const std::array<float, 3> n{normal[0] / distance, normal[1] / distance, normal[2] / distance};
  for (std::size_t i = 0; i < x_.size(); i += kAbreast) {
    for (std::size_t l = 0; l < kAbreast; ++l) {
      const float h = n[0] * x_[i + l] + n[1] * y_[i + l] + n[2] * z_[i + l];
      const float near = 1 - h * h;
      sum[l] += (near > 0 ? near : 0.0F) * weight_[i + l];
    }
  }
  float all = 0;
  for (const float s : sum) all += s;
  return all;
}

bool ConsensusPlane::find(const Vec3f& own, Vec3f& normal) {
  if (neighbours.size() < kLeastNeighbours) return false;
  lay_out();
  float best = kConsensusGain * score(own);
  if (std::accumulate(weight_.begin(), weight_.end(), 0.0F) <= best) return false;
  const std::size_t paired = std::min(kPaired * stride, neighbours.size());
  std::partial_sort(neighbours.begin(), neighbours.begin() + static_cast<std::ptrdiff_t>(paired), neighbours.end(),
                    [](const Vec3f& a, const Vec3f& b) {
                      const float na = inner(a, a);
                      const float nb = inner(b, b);
                      return na != nb ? na < nb : a < b;
                    });
  Quadric quadric;
  bool found = false;
  for (std::size_t j = 0; j < paired; j += stride) {
    for (std::size_t k = j + stride; k < paired; k += stride) {
      const Vec3f& a = neighbours[j];
      const Vec3f& b = neighbours[k];
      const Vec3f across{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
      const float length = std::sqrt(inner(across, across));
      if (!(length > kLeastSine * std::sqrt(inner(a, a) * inner(b, b)))) continue;
      const float scale = inner(across, own) < 0 ? -1 / length : 1 / length;
      const Vec3f n{scale * across[0], scale * across[1], scale * across[2]};
      const float s = score(n);
      if (s <= best) continue;
      best = s;
      quadric.normal = {n[0], n[1], n[2]};
      found = true;
    }
  }
  if (!found) return false;
  for (int fit = 0; fit < kFits; ++fit) quadric = fitted(neighbours, distance, quadric);
  normal = {static_cast<float>(quadric.normal.x()), static_cast<float>(quadric.normal.y()),
            static_cast<float>(quadric.normal.z())};
  return inner(normal, own) > 0;
}

}  // namespace lamina
