// Point clouds on surfaces whose truth is known, and the job run on them.
#pragma once
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "base/temporary_folder.h"
#include "lamina/mesh.h"
#include "lamina/surface.h"
#include "points/ply_files.h"
#include "support/mesh_check.h"

namespace lamina::test {

using Point3 = std::array<double, 3>;

inline double length(const Point3& v) {
  return std::hypot(v[0], v[1], v[2]);
}

struct Cloud {
  std::vector<Point3> positions, normals;
  AttributeLayout extra;  ///< further properties, behind the normals
  std::vector<std::vector<double>> values;

  void add(const Point3& p, const Point3& n) {
    positions.push_back(p);
    normals.push_back(n);
  }
  void add_property(const std::string& name, ScalarType type, const std::function<double(const Point3&)>& value) {
    extra.push_back({name, type});
    auto& column = values.emplace_back();
    for (const Point3& p : positions) column.push_back(value(p));
  }
  [[nodiscard]] std::size_t size() const { return positions.size(); }
};

inline Point3 random_direction(std::mt19937& random) {
  std::normal_distribution<> normal;
  Point3 v{normal(random), normal(random), normal(random)};
  const double l = length(v);
  for (double& c : v) c /= l;
  return v;
}

/// On the unit sphere about the origin; `keep` says which share of the samples stays where.
inline Cloud sphere_cloud(
    std::size_t count, const std::function<double(const Point3&)>& keep = [](const Point3&) { return 1.0; }) {
  std::mt19937 random(1);
  std::uniform_real_distribution<> uniform;
  Cloud cloud;
  while (cloud.size() < count) {
    const Point3 v = random_direction(random);
    if (uniform(random) < keep(v)) cloud.add(v, v);
  }
  return cloud;
}

constexpr double kTorusMajor = 1, kTorusMinor = 0.4;

/// Around the y axis: the sweep does not follow a coordinate axis of the file.
inline Cloud torus_cloud(std::size_t count) {
  std::mt19937 random(2);
  std::uniform_real_distribution<> uniform;
  Cloud cloud;
  while (cloud.size() < count) {
    const double u = 2 * std::numbers::pi * uniform(random);
    const double v = 2 * std::numbers::pi * uniform(random);
    const double around = kTorusMajor + kTorusMinor * std::cos(v);
    if (uniform(random) * (kTorusMajor + kTorusMinor) > around) continue;
    const Point3 n{std::cos(v) * std::cos(u), std::sin(v), std::cos(v) * std::sin(u)};
    cloud.add({around * std::cos(u), kTorusMinor * std::sin(v), around * std::sin(u)}, n);
  }
  return cloud;
}

inline double distance_to_torus(const Point3& p) {
  return std::abs(std::hypot(std::hypot(p[0], p[2]) - kTorusMajor, p[1]) - kTorusMinor);
}

/// The square [-1, 1]^2 tilted about the x axis; rim_distance() of a point is measured in the plane.
struct Plane {
  double tilt = 0.3;
  [[nodiscard]] Point3 at(double u, double v) const { return {u, v * std::cos(tilt), v * std::sin(tilt)}; }
  [[nodiscard]] Point3 normal() const { return {0, -std::sin(tilt), std::cos(tilt)}; }
  [[nodiscard]] double height(const Point3& p) const { return p[2] * std::cos(tilt) - p[1] * std::sin(tilt); }
  [[nodiscard]] double rim_distance(const Point3& p) const {
    const double v = p[1] * std::cos(tilt) + p[2] * std::sin(tilt);
    return std::min(std::abs(1 - std::abs(p[0])), std::abs(1 - std::abs(v)));
  }
};

inline Cloud plane_cloud(std::size_t count, const Plane& plane = {}) {
  std::mt19937 random(3);
  std::uniform_real_distribution<> uniform(-1, 1);
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double u = uniform(random);
    cloud.add(plane.at(u, uniform(random)), plane.normal());
  }
  return cloud;
}

inline PlyModel ply_model(const Cloud& cloud, ScalarType positions = ScalarType::float32) {
  PlyElementModel vertices{"vertex", {}, {}};
  for (const char* name : {"x", "y", "z"}) vertices.columns.push_back({name, positions});
  for (const char* name : {"nx", "ny", "nz"}) vertices.columns.push_back({name});
  for (const AttributeSpec& a : cloud.extra) vertices.columns.push_back({a.name, a.type});
  const auto rounded = [](double v, ScalarType type) { return type == ScalarType::float32 ? double{float(v)} : v; };
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    auto& row = vertices.cells.emplace_back();
    for (const double c : cloud.positions[i]) row.push_back({rounded(c, positions)});
    for (const double c : cloud.normals[i]) row.push_back({rounded(c, ScalarType::float32)});
    for (std::size_t a = 0; a < cloud.extra.size(); ++a) {
      row.push_back({rounded(cloud.values[a][i], cloud.extra[a].type)});
    }
  }
  return {{vertices}};
}

inline std::string write_cloud(const Cloud& cloud, const std::string& path, PlyFormat format = PlyFormat::little_endian,
                               ScalarType positions = ScalarType::float32) {
  return write_file(path, ply_bytes(ply_model(cloud, positions), format));
}

struct Reconstruction {
  TriangleMesh mesh;
  SurfaceStats stats;
  MeshFacts facts;
};

/// Runs the job from file to file. Throws what it throws.
inline Reconstruction reconstruct(const Cloud& cloud, SurfaceSettings settings = {}, const RunContext& run = {}) {
  const TemporaryFolder folder;
  settings.input = write_cloud(cloud, folder / "in.ply");
  settings.output = folder / "out.ply";
  Reconstruction result;
  result.stats = reconstruct_surface(settings, run);
  result.mesh = read_mesh(settings.output);
  result.facts = check_mesh(result.mesh.triangles);
  return result;
}

inline double area(const TriangleMesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const Point3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    const Point3 u{b[0] - a[0], b[1] - a[1], b[2] - a[2]}, v{c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    sum += 0.5 * length({u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]});
  }
  return sum;
}

/// Largest and root mean square distance of the vertices and of the triangles' centres.
struct Deviation {
  double largest = 0, rms = 0;
};
inline Deviation deviation(const TriangleMesh& mesh, const std::function<double(const Point3&)>& distance) {
  Deviation d;
  std::size_t n = 0;
  const auto take = [&](const Point3& p) {
    const double x = distance(p);
    d.largest = std::max(d.largest, x);
    d.rms += x * x;
    ++n;
  };
  for (const Point3& p : mesh.positions) take(p);
  for (const auto& t : mesh.triangles) {
    Point3 centre{};
    for (const std::uint32_t v : t) {
      for (std::size_t k = 0; k < 3; ++k) centre[k] += mesh.positions[v][k] / 3;
    }
    take(centre);
  }
  d.rms = std::sqrt(d.rms / static_cast<double>(n));
  return d;
}

inline double distance_to_sphere(const Point3& p) {
  return std::abs(length(p) - 1);
}

}  // namespace lamina::test
