#include "scatter/mesh_surface.h"

#include <memory>
#include <vector>

#include "base/hashing.h"
#include "lamina/error.h"
#include "lamina/scatter.h"
#include "measure/triangle_bvh.h"
#include "meshes/area_sampler.h"
#include "meshes/vec3.h"
#include "scatter/shapes.h"

namespace lamina::scatter_detail {

using namespace meshes;

namespace {

std::vector<std::array<float, 3>> vertex_normals(const TriangleMesh& mesh) {
  std::vector<Vec3> sums(mesh.positions.size());
  for (const auto& t : mesh.triangles) {
    const Vec3 a = mesh.positions[t[0]];
    const Vec3 n = cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
    for (const auto v : t) sums[v] = sums[v] + n;
  }
  std::vector<std::array<float, 3>> normals(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) normals[i] = to_float(unit(sums[i]));
  return normals;
}

}  // namespace

MeshAttributes::MeshAttributes(const TriangleMesh& mesh)
    : mesh_(mesh),
      made_normals_(mesh.normals.empty() ? vertex_normals(mesh) : std::vector<std::array<float, 3>>{}),
      normals_(mesh.normals.empty() ? made_normals_ : mesh.normals),
      colours_(find_colours(mesh)) {}

Vec3 MeshAttributes::normal(const SurfacePoint& at) const {
  const auto& c = mesh_.triangles[at.triangle];
  const Vec3 a = mesh_.positions[c[0]];
  const Vec3 n = at.weights[0] * unit(to_double(normals_[c[0]])) + at.weights[1] * unit(to_double(normals_[c[1]])) +
                 at.weights[2] * unit(to_double(normals_[c[2]]));
  const double length = norm(n);
  if (length > 1e-6) return (1 / length) * n;
  return unit(cross(mesh_.positions[c[1]] - a, mesh_.positions[c[2]] - a));
}

std::array<float, 3> MeshAttributes::colour(const SurfacePoint& at) const {
  std::array<float, 3> out{};
  if (!colours_) return out;
  const auto& c = mesh_.triangles[at.triangle];
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const auto value = colours_->at(mesh_, c[corner]);
    for (std::size_t k = 0; k < 3; ++k) out[k] += static_cast<float>(at.weights[corner]) * value[k];
  }
  return out;
}

}  // namespace lamina::scatter_detail

namespace lamina {
namespace {

using namespace meshes;

class MeshSurface final : public Surface {
 public:
  explicit MeshSurface(const TriangleMesh& mesh) : mesh_(mesh), areas_(mesh), attributes_(mesh) {
    if (mesh.triangles.empty()) throw Error(ExitCode::unreadable, "scatter: the mesh has no triangles");
    if (!(areas_.total_area() > 0)) throw Error(ExitCode::unreadable, "scatter: the mesh's triangles have no area");
    const measure::Bounds bounds = measure::triangle_bounds(mesh);
    box_ = {bounds.low, bounds.high};
  }
  [[nodiscard]] Point point(std::uint64_t seed, std::uint64_t sample, std::uint32_t attempt) const override {
    CounterRng rng(scatter_detail::attempt_seed(seed, attempt), sample);
    const double u = rng.uniform(), v = rng.uniform(), w = rng.uniform();
    const SurfacePoint at = areas_.at(u, v, w);
    return {position_at(mesh_, at), attributes_.normal(at), attributes_.colour(at)};
  }
  [[nodiscard]] double area() const override { return areas_.total_area(); }
  [[nodiscard]] Box box() const override { return box_; }
  [[nodiscard]] bool has_colour() const override { return attributes_.has_colour(); }

 private:
  const TriangleMesh& mesh_;
  AreaSampler areas_;
  scatter_detail::MeshAttributes attributes_;
  Box box_;
};

}  // namespace

std::unique_ptr<Surface> mesh_surface(const TriangleMesh& mesh) {
  return std::make_unique<MeshSurface>(mesh);
}

}  // namespace lamina
