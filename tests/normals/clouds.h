// Point clouds in memory as sources, and what became of their normals.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "lamina/normals.h"
#include "lamina/points.h"

namespace lamina::test {

using Vector = std::array<double, 3>;

inline double dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

struct Oriented {
  std::vector<Vector> positions, normals;
  std::vector<ScanPart> scans;
  void add(const Vector& p, const Vector& n) {
    positions.push_back(p);
    normals.push_back(n);
  }
  [[nodiscard]] std::size_t size() const { return positions.size(); }
};

class OrientedSource final : public PointSource {
 public:
  OrientedSource(const Oriented& cloud, bool with_normals) : cloud_(cloud) {
    info_.path = "cloud";
    info_.count = cloud.size();
    info_.has_normals = with_normals;
    info_.random_access = true;
    info_.scans = cloud.scans;
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const std::size_t n = std::min<std::uint64_t>(count, info_.count - std::min(first, info_.count));
    out = {};
    out.first = first;
    for (std::size_t i = first; i < first + n; ++i) {
      out.x.push_back(cloud_.positions[i][0]);
      out.y.push_back(cloud_.positions[i][1]);
      out.z.push_back(cloud_.positions[i][2]);
      if (!info_.has_normals) continue;
      out.nx.push_back(static_cast<float>(cloud_.normals[i][0]));
      out.ny.push_back(static_cast<float>(cloud_.normals[i][1]));
      out.nz.push_back(static_cast<float>(cloud_.normals[i][2]));
    }
  }

 private:
  const Oriented& cloud_;
};

inline Vector random_direction(std::mt19937& random) {
  std::normal_distribution<> normal;
  Vector v{normal(random), normal(random), normal(random)};
  const double l = std::sqrt(dot(v, v));
  for (double& c : v) c /= l;
  return v;
}

inline void add_sphere(Oriented& cloud, std::size_t count, double radius, const Vector& centre = {}) {
  std::mt19937 random(7);
  for (std::size_t i = 0; i < count; ++i) {
    const Vector n = random_direction(random);
    cloud.add({centre[0] + radius * n[0], centre[1] + radius * n[1], centre[2] + radius * n[2]}, n);
  }
}

/// Around the y axis, radii 1 and 0.4.
inline void add_torus(Oriented& cloud, std::size_t count) {
  std::mt19937 random(2);
  std::uniform_real_distribution<> uniform;
  while (cloud.size() < count) {
    const double u = 2 * std::numbers::pi * uniform(random);
    const double v = 2 * std::numbers::pi * uniform(random);
    const double around = 1 + 0.4 * std::cos(v);
    if (uniform(random) * 1.4 > around) continue;
    cloud.add({around * std::cos(u), 0.4 * std::sin(v), around * std::sin(u)},
              {std::cos(v) * std::cos(u), std::sin(v), std::cos(v) * std::sin(u)});
  }
}

/// Samples over the unit square at height z(x, y), normals upward.
template <class Height>
void add_sheet(Oriented& cloud, std::size_t count, const Height& height) {
  std::mt19937 random(3);
  std::uniform_real_distribution<> uniform;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = uniform(random);
    const double y = uniform(random);
    constexpr double h = 1e-6;
    const double dx = (height(x + h, y) - height(x - h, y)) / (2 * h);
    const double dy = (height(x, y + h) - height(x, y - h)) / (2 * h);
    const double l = std::sqrt(1 + dx * dx + dy * dy);
    cloud.add({x, y, height(x, y)}, {-dx / l, -dy / l, 1 / l});
  }
}

inline std::vector<Vector> normals_of(PointSource& source) {
  SampleBatch batch;
  source.read(0, source.info().count, batch);
  std::vector<Vector> normals;
  for (std::size_t i = 0; i < batch.size(); ++i) normals.push_back({batch.nx[i], batch.ny[i], batch.nz[i]});
  return normals;
}

inline NormalsSettings in_mode(NormalsMode mode, int k = 16) {
  NormalsSettings settings;
  settings.mode = mode;
  settings.k = k;
  return settings;
}

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Found {
  std::vector<Vector> normals;
  NormalsReport report;
};

inline Found find_normals(const Oriented& cloud, const NormalsSettings& settings = {}, bool with_normals = false,
                          int threads = 2) {
  Found found;
  RunContext run;
  run.threads = threads;
  const auto source =
      lamina::with_normals(std::make_unique<OrientedSource>(cloud, with_normals), settings, found.report, run);
  found.normals = normals_of(*source);
  return found;
}

/// Shares of the samples whose normal lies within an angle of the truth's line, and on its side.
struct Quality {
  double close = 0, right_side = 0;
};

inline Quality compare(const Oriented& truth, const std::vector<Vector>& normals, double degrees = 15) {
  const double cosine = std::cos(degrees * std::numbers::pi / 180);
  Quality q;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double d = dot(truth.normals[i], normals[i]);
    q.close += std::abs(d) >= cosine ? 1 : 0;
    q.right_side += d > 0 ? 1 : 0;
  }
  q.close /= static_cast<double>(truth.size());
  q.right_side /= static_cast<double>(truth.size());
  return q;
}

}  // namespace lamina::test
