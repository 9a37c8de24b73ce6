#include "simplify/thinning.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "lamina/error.h"
#include "meshes/mesh_blocks.h"
#include "simplify/cut.h"
#include "simplify/matching.h"
#include "simplify/thin_window.h"

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr std::size_t kBoxTriangles = 1U << 15;  ///< that one thread works on at a time
/// How far the values of an attribute may differ that one vertex stands for, in standard deviations of it.
constexpr double kSameValue = 0.25;

/// Of each attribute.
std::vector<float> find_tolerances(MeshBlocks& mesh) {
  std::vector<double> sum(mesh.layout().size()), square(sum.size());
  if (sum.empty() || mesh.vertices() == 0) return {};
  std::vector<double> first;  // what they are counted from, for the digits
  for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
    if (first.empty()) {
      for (const auto& values : block.attributes) first.push_back(static_cast<double>(values[v]));
    }
    for (std::size_t a = 0; a < sum.size(); ++a) {
      const double value = static_cast<double>(block.attributes[a][v]) - first[a];
      sum[a] += value;
      square[a] += value * value;
    }
  });
  std::vector<float> tolerances;
  const auto n = static_cast<double>(mesh.vertices());
  for (std::size_t a = 0; a < sum.size(); ++a) {
    const double variance = std::max(0.0, square[a] / n - sum[a] / n * (sum[a] / n));
    tolerances.push_back(static_cast<float>(kSameValue * std::sqrt(variance)));
  }
  return tolerances;
}

class Thinner {
 public:
  Thinner(MeshBlocks& mesh, double deviation, const RunContext& run)
      : mesh_(mesh), run_(run), tolerances_(find_tolerances(mesh)), window_(mesh, deviation) {}

  SimplifyStats thin(std::size_t block, const std::function<void(TriangleMesh)>& take) {
    SimplifyStats stats;
    stats.triangles_before = mesh_.triangles();
    const auto all = static_cast<std::int64_t>((mesh_.triangles() + block - 1) / block);
    std::int64_t blocks = 0;
    std::vector<Triangle> triangles;
    for (std::uint64_t done = 0; done < mesh_.triangles();) {
      if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
      mesh_.read_triangles(done, std::min<std::uint64_t>(block, mesh_.triangles() - done), triangles);
      done += triangles.size();
      window_.add(triangles);
      work();
      TriangleMesh piece = window_.give(done == mesh_.triangles());
      stats.triangles_after += piece.triangles.size();
      take(std::move(piece));
      ++blocks;
      if (run_.progress) run_.progress({"simplify", 0, 0, blocks, all});
    }
    stats.vertices_after = window_.vertices_given();
    stats.contractions = contractions_;
    stats.reached = true;
    stats.deviation = deviation_;
    return stats;
  }

 private:
  /// Boxes side by side, then what lies along their borders.
  void work() {
    std::vector<Centre> centres(window_.triangles());
    for (std::uint32_t t = 0; t < centres.size(); ++t) centres[t] = {window_.centre(t), t};
    std::vector<std::uint32_t> order;
    const std::vector<std::size_t> starts = cut_into_boxes(std::move(centres), kBoxTriangles, 0.5, order);
    const std::vector<std::uint32_t> border = work_on(order, starts);
    if (starts.size() > 2 && !border.empty()) work_on(border, std::array<std::size_t, 2>{0, border.size()});
  }

  /// `order`: of the window's triangles those of one box after the other, which begin at `starts`.
  std::vector<std::uint32_t> work_on(std::span<const std::uint32_t> order, std::span<const std::size_t> starts) {
    const std::size_t boxes = starts.size() - 1;
    std::vector<ThinWindow::Part> parts(boxes);
    std::vector<Matching::Result> results(boxes);
    tbb::parallel_for(std::size_t{0}, boxes, [&](std::size_t b) {
      parts[b] = window_.part(order.subspan(starts[b], starts[b + 1] - starts[b]), numbers_.local());
      results[b] = matchings_.local().thin(parts[b].thin, tolerances_, run_);
    });
    for (std::size_t b = 0; b < boxes; ++b) {
      window_.put_back(parts[b]);
      contractions_ += (parts[b].triangles.size() - results[b].triangles) / 2;
      deviation_ = std::max(deviation_, results[b].deviation);
    }
    return window_.settle(parts);
  }

  MeshBlocks& mesh_;
  const RunContext& run_;
  std::vector<float> tolerances_;
  ThinWindow window_;
  tbb::enumerable_thread_specific<Matching> matchings_;
  tbb::enumerable_thread_specific<std::vector<std::uint32_t>> numbers_;  ///< ThinWindow::part()
  std::uint64_t contractions_ = 0;
  double deviation_ = 0;
};

}  // namespace

SimplifyStats thin_blocks(MeshBlocks& mesh, double deviation, const std::function<void(TriangleMesh)>& take,
                          const RunContext& run, std::size_t block) {
  return Thinner(mesh, deviation, run).thin(block, take);
}

}  // namespace lamina::simplify
