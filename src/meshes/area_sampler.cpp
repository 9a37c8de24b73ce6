#include "meshes/area_sampler.h"

#include <algorithm>
#include <cmath>

#include "meshes/vec3.h"

namespace lamina::meshes {

double triangle_area(const TriangleMesh& mesh, std::size_t t) {
  const auto& c = mesh.triangles[t];
  const Vec3 a = mesh.positions[c[0]];
  return 0.5 * norm(cross(mesh.positions[c[1]] - a, mesh.positions[c[2]] - a));
}

AreaSampler::AreaSampler(const TriangleMesh& mesh) : cumulative_(mesh.triangles.size()), guide_(mesh.triangles.size()) {
  double sum = 0;
  for (std::size_t t = 0; t < cumulative_.size(); ++t) cumulative_[t] = sum += triangle_area(mesh, t);
  const double part = sum / static_cast<double>(guide_.size());
  std::uint32_t t = 0;
  for (std::size_t g = 0; g < guide_.size(); ++g) {
    while (t + 1 < cumulative_.size() && cumulative_[t] <= part * static_cast<double>(g)) ++t;
    guide_[g] = t;
  }
}

SurfacePoint AreaSampler::at(double u, double v, double w) const {
  const double area = u * total_area();
  const auto last = static_cast<std::uint32_t>(cumulative_.size() - 1);
  std::uint32_t t =
      guide_[std::min(static_cast<std::size_t>(u * static_cast<double>(guide_.size())), guide_.size() - 1)];
  while (t > 0 && cumulative_[t - 1] > area) --t;
  while (t < last && cumulative_[t] <= area) ++t;
  // Square-root map of the unit square to the triangle (Turk, Graphics Gems 1990).
  const double s = std::sqrt(v);
  return {t, {1 - s, s * (1 - w), s * w}};
}

Vec3 position_at(const TriangleMesh& mesh, const SurfacePoint& p) {
  const auto& c = mesh.triangles[p.triangle];
  return p.weights[0] * mesh.positions[c[0]] + p.weights[1] * mesh.positions[c[1]] +
         p.weights[2] * mesh.positions[c[2]];
}

}  // namespace lamina::meshes
