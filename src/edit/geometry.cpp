#include "lamina/edit.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <unordered_map>
#include <utility>

#include "base/run.h"
#include "lamina/error.h"
#include "meshes/vec3.h"

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
namespace {

using namespace meshes;

std::vector<HalfSpace> faces_of(const ClipRegion& region) {
  std::vector<HalfSpace> faces;
  if (region.box) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Vec3 up{}, down{};
      up[axis] = 1;
      down[axis] = -1;
      faces.push_back({region.box->low, up});
      faces.push_back({region.box->high, down});
    }
  }
  for (const HalfSpace& h : region.half_spaces) faces.push_back({h.point, unit(h.normal)});
  return faces;
}

double height(const HalfSpace& face, const Vec3& p) {
  return dot(face.normal, p - face.point);
}

/// A mesh being cut, with what is known of each triangle: inside all faces so far?
struct Pieces {
  TriangleMesh mesh;
  std::vector<std::uint8_t> inside;
};

class Cutter {
 public:
  Cutter(TriangleMesh& mesh, const HalfSpace& face) : mesh_(mesh), face_(face), heights_(mesh.positions.size()) {
    tbb::parallel_for(std::size_t{0}, heights_.size(),
                      [&](std::size_t v) { heights_[v] = height(face_, mesh_.positions[v]); });
  }

  /// Cuts a triangle into what lies before the face and behind it: polygons, of fewer than three corners when nothing
  /// does.
  void cut(const std::array<std::uint32_t, 3>& t, std::vector<std::uint32_t>& before,
           std::vector<std::uint32_t>& behind) {
    before.clear();
    behind.clear();
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k], b = t[(k + 1) % 3];
      if (heights_[a] >= 0) before.push_back(a);
      if (heights_[a] <= 0) behind.push_back(a);
      if ((heights_[a] > 0 && heights_[b] < 0) || (heights_[a] < 0 && heights_[b] > 0)) {
        const std::uint32_t v = crossing(a, b);
        before.push_back(v);
        behind.push_back(v);
      }
    }
    // What lies in the face counts as before it. Polygons of one or two corners only touch it and are passed over.
    if (before.size() == 3 && behind.size() == 3 && before == behind) behind.clear();
  }

 private:
  std::uint32_t crossing(std::uint32_t a, std::uint32_t b) {
    if (a > b) std::swap(a, b);
    const auto next = static_cast<std::uint32_t>(mesh_.positions.size());
    const auto [at, is_new] = vertices_.try_emplace((std::uint64_t{a} << 32) | b, next);
    if (!is_new) return at->second;
    const double t = heights_[a] / (heights_[a] - heights_[b]);
    Vec3 p = mesh_.positions[a] + t * (mesh_.positions[b] - mesh_.positions[a]);
    p = p - height(face_, p) * face_.normal;
    mesh_.positions.push_back(p);
    if (!mesh_.normals.empty()) {
      const Vec3 n = (1 - t) * to_double(mesh_.normals[a]) + t * to_double(mesh_.normals[b]);
      mesh_.normals.push_back(to_float(unit(n)));
    }
    for (auto& values : mesh_.attributes) {
      values.push_back(static_cast<float>((1 - t) * double{values[a]} + t * double{values[b]}));
    }
    heights_.push_back(0);
    return next;
  }

  TriangleMesh& mesh_;
  HalfSpace face_;
  std::vector<double> heights_;                                ///< of vertices over the face
  std::unordered_map<std::uint64_t, std::uint32_t> vertices_;  ///< made on edges, by their ends
};

/// Triangulates a polygon of three or four corners along its shorter diagonal.
void add_polygon(const TriangleMesh& mesh, const std::vector<std::uint32_t>& corners,
                 std::vector<std::array<std::uint32_t, 3>>& triangles) {
  if (corners.size() == 3) {
    triangles.push_back({corners[0], corners[1], corners[2]});
  } else if (corners.size() == 4) {
    const auto length = [&](std::size_t i, std::size_t j) {
      return norm(mesh.positions[corners[i]] - mesh.positions[corners[j]]);
    };
    const std::size_t k = length(0, 2) <= length(1, 3) ? 0 : 1;
    triangles.push_back({corners[k], corners[k + 1], corners[k + 2]});
    triangles.push_back({corners[k], corners[k + 2], corners[(k + 3) % 4]});
  }
}

void cut_along(Pieces& pieces, const HalfSpace& face, Keep keep) {
  Cutter cutter(pieces.mesh, face);
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::uint8_t> inside;
  std::vector<std::uint32_t> before, behind;
  for (std::size_t i = 0; i < pieces.mesh.triangles.size(); ++i) {
    cutter.cut(pieces.mesh.triangles[i], before, behind);
    add_polygon(pieces.mesh, before, triangles);
    inside.resize(triangles.size(), pieces.inside[i]);
    if (keep == Keep::inside) continue;
    add_polygon(pieces.mesh, behind, triangles);
    inside.resize(triangles.size(), 0);
  }
  pieces.mesh.triangles = std::move(triangles);
  pieces.inside = std::move(inside);
}

/// The vertices v with keep[v] != 0 in order, and the triangles all of whose corners stay.
TriangleMesh only_vertices(const TriangleMesh& mesh, const std::vector<std::uint8_t>& keep) {
  TriangleMesh out;
  out.layout = mesh.layout;
  out.attributes.resize(mesh.attributes.size());
  std::vector<std::uint32_t> number(mesh.positions.size());
  for (std::size_t v = 0; v < keep.size(); ++v) {
    if (keep[v] == 0) continue;
    number[v] = static_cast<std::uint32_t>(out.positions.size());
    out.positions.push_back(mesh.positions[v]);
    if (!mesh.normals.empty()) out.normals.push_back(mesh.normals[v]);
    for (std::size_t a = 0; a < mesh.attributes.size(); ++a) out.attributes[a].push_back(mesh.attributes[a][v]);
  }
  for (const auto& t : mesh.triangles) {
    if (std::all_of(t.begin(), t.end(), [&](auto v) { return keep[v] != 0; }))
      out.triangles.push_back({number[t[0]], number[t[1]], number[t[2]]});
  }
  return out;
}

/// Without the vertices that are in no triangle.
TriangleMesh without_unused_vertices(TriangleMesh mesh) {
  std::vector<std::uint8_t> used(mesh.positions.size());
  for (const auto& t : mesh.triangles)
    for (const auto v : t) used[v] = 1;
  if (std::find(used.begin(), used.end(), 0) == used.end()) return mesh;
  return only_vertices(mesh, used);
}

TriangleMesh clip_vertices(const TriangleMesh& mesh, const ClipRegion& region, Keep keep) {
  std::vector<std::uint8_t> kept(mesh.positions.size());
  for (std::size_t v = 0; v < kept.size(); ++v) {
    kept[v] = contains(region, mesh.positions[v]) == (keep == Keep::inside) ? 1 : 0;
  }
  return only_vertices(mesh, kept);
}

}  // namespace

void require_sane(const ClipRegion& region) {
  const auto finite = [](const Vec3& v) {
    return std::all_of(v.begin(), v.end(), [](double c) { return std::isfinite(c); });
  };
  if (!region.box && region.half_spaces.empty()) throw Error(ExitCode::usage, "clip: give it a box or a plane");
  if (region.box) {
    if (!finite(region.box->low) || !finite(region.box->high))
      throw Error(ExitCode::usage, "clip: the box has a coordinate that is not finite");
    for (std::size_t k = 0; k < 3; ++k) {
      if (region.box->low[k] > region.box->high[k])
        throw Error(ExitCode::usage,
                    fmt::format("clip: the box ends at {} = {} before it begins at {}; the lower corner comes first",
                                "xyz"[k], region.box->high[k], region.box->low[k]));
    }
  }
  for (const HalfSpace& h : region.half_spaces) {
    if (!finite(h.point) || !finite(h.normal) || !(norm(h.normal) > 0))
      throw Error(ExitCode::usage, "clip: a plane wants a point and a normal that is not zero, all finite");
  }
}

bool contains(const ClipRegion& region, const std::array<double, 3>& p) {
  if (region.box) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (!(p[k] >= region.box->low[k] && p[k] <= region.box->high[k])) return false;
    }
  }
  return std::all_of(region.half_spaces.begin(), region.half_spaces.end(),
                     [&](const HalfSpace& h) { return dot(h.normal, p - h.point) >= 0; });
}

void clip_rows(SampleBatch& batch, const ClipRegion& region, Keep keep) {
  std::vector<std::uint8_t> kept(batch.size());
  for (std::size_t i = 0; i < kept.size(); ++i) {
    kept[i] = contains(region, {batch.x[i], batch.y[i], batch.z[i]}) == (keep == Keep::inside) ? 1 : 0;
  }
  keep_rows(batch, kept);
}

TriangleMesh clip_mesh(const TriangleMesh& mesh, const ClipRegion& region, Keep keep, const RunContext& run) {
  require_sane(region);
  if (mesh.triangles.empty()) return clip_vertices(mesh, region, keep);
  Pieces pieces{mesh, std::vector<std::uint8_t>(mesh.triangles.size(), 1)};
  with_threads(run.threads, [&] {
    for (const HalfSpace& face : faces_of(region)) {
      if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
      cut_along(pieces, face, keep);
    }
  });
  if (keep == Keep::outside) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < pieces.inside.size(); ++i) {
      if (pieces.inside[i] == 0) pieces.mesh.triangles[kept++] = pieces.mesh.triangles[i];
    }
    pieces.mesh.triangles.resize(kept);
  }
  return without_unused_vertices(std::move(pieces.mesh));
}

}  // namespace lamina
