#include "lamina/measure.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/hashing.h"
#include "base/run.h"
#include "lamina/error.h"
#include "measure/triangle_bvh.h"
#include "meshes/area_sampler.h"

namespace lamina {
namespace {

using namespace meshes;

/// Samples of one side by number: stratified by area on a mesh, the points themselves of a cloud.
class SideSampler {
 public:
  SideSampler(const TriangleMesh& mesh, const CompareSettings& settings, std::uint64_t stream)
      : mesh_(mesh),
        areas_(mesh),
        seed_(settings.seed * 2 + stream),
        count_(mesh.triangles.empty() ? mesh.positions.size() : settings.count) {
    if (settings.vertices && !mesh.triangles.empty()) list_vertices();
    if (!mesh.triangles.empty() && !(areas_.total_area() > 0))
      throw Error(ExitCode::unreadable, "compare: a mesh whose triangles have no area cannot be sampled");
  }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] Vec3 at(std::uint64_t i) const {
    if (mesh_.triangles.empty()) return mesh_.positions[i];
    if (!vertices_.empty()) return mesh_.positions[vertices_[i]];
    CounterRng rng(seed_, i);
    const double u = (static_cast<double>(i) + rng.uniform()) / static_cast<double>(count_);
    const double v = rng.uniform(), w = rng.uniform();
    return position_at(mesh_, areas_.at(u, v, w));
  }

 private:
  void list_vertices() {
    std::vector<bool> used(mesh_.positions.size(), false);
    for (const auto& t : mesh_.triangles)
      for (const auto v : t) used[v] = true;
    for (std::uint32_t v = 0; v < used.size(); ++v)
      if (used[v]) vertices_.push_back(v);
    count_ = vertices_.size();
  }

  const TriangleMesh& mesh_;
  AreaSampler areas_;
  std::uint64_t seed_, count_;
  std::vector<std::uint32_t> vertices_;  ///< the samples, where these are asked for
};

DistanceStats measure_side(const TriangleMesh& from, const TriangleMesh& to, const CompareSettings& settings,
                           std::uint64_t stream) {
  const SideSampler sampler(from, settings, stream);
  const measure::TriangleBvh tree(to);
  std::vector<double> distances(sampler.count());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, distances.size(), 1024),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i < range.end(); ++i)
                        distances[i] = tree.distance(sampler.at(i));
                    });
  // Summed in ascending order, by one thread: exact to the last bit whatever the threads did.
  std::sort(distances.begin(), distances.end());
  DistanceStats stats;
  stats.samples = distances.size();
  double sum = 0, squares = 0;
  for (const double d : distances) {
    sum += d;
    squares += d * d;
  }
  const auto n = static_cast<double>(distances.size());
  stats.mean = sum / n;
  stats.rms = std::sqrt(squares / n);
  stats.p99 = distances[static_cast<std::size_t>(std::ceil(0.99 * n)) - 1];
  stats.max = distances.back();
  return stats;
}

double diagonal_of(const TriangleMesh& mesh) {
  if (mesh.positions.empty()) return 0;
  measure::Bounds box{mesh.positions[0], mesh.positions[0]};
  if (!mesh.triangles.empty()) {
    box = measure::triangle_bounds(mesh);
  } else {
    for (const auto& p : mesh.positions) widen(box, p);
  }
  return norm(box.high - box.low);
}

}  // namespace

CompareResult compare(const TriangleMesh& a, const TriangleMesh& b, const CompareSettings& settings,
                      const RunContext& run) {
  if (settings.count == 0) throw Error(ExitCode::usage, "compare: --count must be at least 1");
  if (a.triangles.empty() && b.triangles.empty())
    throw Error(ExitCode::unreadable, "compare: neither side has triangles; one of the two must be a mesh");
  CompareResult result;
  result.diagonal = diagonal_of(b);
  with_threads(run.threads, [&] {
    if (!b.triangles.empty()) result.a_to_b = measure_side(a, b, settings, 0);
    if (!a.triangles.empty()) result.b_to_a = measure_side(b, a, settings, 1);
  });
  return result;
}

}  // namespace lamina
