#include <algorithm>
#include <cmath>
#include <optional>

#include "base/counter_rng.h"
#include "lamina/error.h"
#include "lamina/scatter.h"
#include "meshes/area_sampler.h"
#include "scatter/attempt_seed.h"
#include "scatter/interpolate.h"

namespace lamina {
namespace {

using namespace meshes;

class MeshSurface final : public Surface {
 public:
  explicit MeshSurface(const TriangleMesh& mesh) : mesh_(mesh), areas_(mesh), attributes_(mesh) {
    if (mesh.triangles.empty()) throw Error(ExitCode::unreadable, "scatter: the mesh has no triangles");
    if (!(areas_.total_area() > 0)) throw Error(ExitCode::unreadable, "scatter: the mesh's triangles have no area");
    box_.low = box_.high = mesh.positions[mesh.triangles[0][0]];
    for (const auto& t : mesh.triangles)
      for (const auto v : t)
        for (std::size_t k = 0; k < 3; ++k) {
          box_.low[k] = std::min(box_.low[k], mesh.positions[v][k]);
          box_.high[k] = std::max(box_.high[k], mesh.positions[v][k]);
        }
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
