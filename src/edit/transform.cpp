#include "lamina/edit.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "lamina/error.h"

namespace lamina {
namespace {

/// Sine and cosine of an angle in degrees, exact where they are 0 or 1: half a pi has no exact double.
std::array<double, 2> sine_cosine(double degrees) {
  const double turn = std::fmod(degrees, 360.0);
  const double quarters = turn / 90;
  if (quarters == std::floor(quarters)) {
    const int q = ((static_cast<int>(quarters) % 4) + 4) % 4;
    constexpr std::array<std::array<double, 2>, 4> kExact{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};
    return kExact.at(static_cast<std::size_t>(q));
  }
  const double radians = turn * std::numbers::pi / 180;
  return {std::sin(radians), std::cos(radians)};
}

/// About axis k.
Eigen::Matrix3d rotation(int k, double degrees) {
  const auto [s, c] = sine_cosine(degrees);
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  Eigen::Matrix3d r = Eigen::Matrix3d::Identity();
  r(i, i) = c;
  r(i, j) = -s;
  r(j, i) = s;
  r(j, j) = c;
  return r;
}

/// The normal in its new direction; its length stays.
template <class T>
std::array<float, 3> turned(const Eigen::Matrix3d& by, T x, T y, T z) {
  const Eigen::Vector3d n(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z));
  const Eigen::Vector3d m = by * n;
  const double length = m.norm();
  const Eigen::Vector3d out = length > 0 ? Eigen::Vector3d(m * (n.norm() / length)) : n;
  return {static_cast<float>(out.x()), static_cast<float>(out.y()), static_cast<float>(out.z())};
}

}  // namespace

Eigen::Affine3d make_transform(const TransformSettings& s) {
  const Eigen::Matrix3d linear =
      rotation(2, s.rotate.z()) * rotation(1, s.rotate.y()) * rotation(0, s.rotate.x()) * s.scale.asDiagonal();
  Eigen::Affine3d t = Eigen::Affine3d::Identity();
  t.linear() = linear;
  t.translation() = s.pivot + s.translate - linear * s.pivot;
  require_invertible(t.matrix());
  return t;
}

void require_invertible(const Eigen::Matrix4d& m) {
  if (!m.allFinite()) throw Error(ExitCode::usage, "transform: a number is not finite");
  if (m.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw Error(ExitCode::usage,
                "transform: the matrix's last row is not 0 0 0 1; write it row by row, the translation in the last "
                "column");
  const double size = m.topLeftCorner<3, 3>().norm();
  if (!(std::abs(m.topLeftCorner<3, 3>().determinant()) > 1e-12 * size * size * size))
    throw Error(ExitCode::usage, "transform: it flattens everything (a scale of 0, or a singular matrix)");
}

void transform_rows(SampleBatch& b, const Eigen::Affine3d& transform) {
  const Eigen::Matrix3d normal_map = transform.linear().inverse().transpose();
  const auto radius_scale = static_cast<float>(std::cbrt(std::abs(transform.linear().determinant())));
  for (std::size_t i = 0; i < b.size(); ++i) {
    const Eigen::Vector3d p = transform * Eigen::Vector3d(b.x[i], b.y[i], b.z[i]);
    b.x[i] = p.x();
    b.y[i] = p.y();
    b.z[i] = p.z();
  }
  for (std::size_t i = 0; i < b.nx.size(); ++i) {
    const auto n = turned(normal_map, b.nx[i], b.ny[i], b.nz[i]);
    b.nx[i] = n[0];
    b.ny[i] = n[1];
    b.nz[i] = n[2];
  }
  for (float& r : b.radius) r *= radius_scale;
}

void transform_mesh(TriangleMesh& mesh, const Eigen::Affine3d& transform) {
  const Eigen::Matrix3d normal_map = transform.linear().inverse().transpose();
  for (auto& p : mesh.positions) {
    const Eigen::Vector3d q = transform * Eigen::Vector3d(p[0], p[1], p[2]);
    p = {q.x(), q.y(), q.z()};
  }
  for (auto& n : mesh.normals) n = turned(normal_map, n[0], n[1], n[2]);
  if (transform.linear().determinant() < 0)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
}

bool wants_double(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  const double largest = std::max(low.cwiseAbs().maxCoeff(), high.cwiseAbs().maxCoeff());
  constexpr double kFloatRounding = 0x1p-24, kShare = 1e-6, kLargestFloat = 1e37;
  return largest * kFloatRounding > kShare * (high - low).norm() || largest > kLargestFloat;
}

}  // namespace lamina
