#include "simplify/thinning.h"

#include <fmt/format.h>
#include <tbb/concurrent_queue.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/hashing.h"
#include "lamina/error.h"
#include "measure/edge_table.h"
#include "meshes/mesh_blocks.h"
#include "meshes/vec3.h"
#include "simplify/matching.h"

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr double kEdgeOverArea = 2.3094;  ///< the squared side of an equilateral triangle over its area

}  // namespace

void refuse_to_thin(const char* what) {
  throw Error(ExitCode::unreadable,
              std::string("simplify: the mesh is not manifold: ") + what + "; 'lamina check' tells more");
}

void ThinBlock::read(MeshBlocks& mesh, std::uint64_t first, std::size_t count) {
  mesh.read_triangles(first, count, part.triangles);
  for (const Triangle& t : part.triangles) {
    if (std::max({t[0], t[1], t[2]}) >= mesh.vertices())
      throw Error(ExitCode::unreadable, "simplify: a triangle names a vertex that the mesh does not have");
    if (measure::repeats_index(t)) refuse_to_thin("a triangle names a vertex twice");
  }
  VertexNumbers numbers(part.triangles);
  for (Triangle& t : part.triangles) t = {numbers.of(t[0]), numbers.of(t[1]), numbers.of(t[2])};
  ids = numbers.vertices();
  part.vertices.assign(ids.size(), {});
  part.carried.normals.clear();
  part.carried.values.resize(mesh.layout().size());
  for (auto& values : part.carried.values) values.clear();
  std::size_t v = 0;
  const auto rows = [&](std::uint64_t from, std::size_t size, TriangleMesh& out) {
    mesh.read_vertices(from, size, out);
  };
  for_vertex_rows(ids, rows, [&](const TriangleMesh& block, std::size_t row) {
    Vec3& at = part.vertices[v].at;
    at = block.positions[row];
    if (!(std::isfinite(at[0]) && std::isfinite(at[1]) && std::isfinite(at[2])))
      throw Error(ExitCode::unreadable, fmt::format("simplify: vertex {} of the mesh is not finite", ids[v]));
    if (mesh.has_normals()) part.carried.normals.push_back(block.normals[row]);
    for (std::size_t a = 0; a < part.carried.values.size(); ++a)
      part.carried.values[a].push_back(block.attributes[a][row]);
    ++v;
  });
  part.low = part.carried.values;
  part.high = part.carried.values;
}

/// What a triangle adds to a budget goes with the size of those around it.
void ThinBlock::survey(double deviation) {
  struct Sums {
    std::uint64_t hash = 0;
    float area = 0, corners = 0;
  };
  std::vector<Sums> sums(ids.size());
  for (std::size_t v = 0; v < ids.size(); ++v) sums[v].hash = scrambled(ids[v]);
  turns.assign(ids.size(), 0);
  std::vector<float> areas;
  areas.reserve(part.triangles.size());
  for (const Triangle& t : part.triangles) {
    const Vec3 n = area_normal(part.vertices[t[0]].at, part.vertices[t[1]].at, part.vertices[t[2]].at);
    const double twice = norm(n);
    areas.push_back(static_cast<float>(0.5 * twice));
    for (std::size_t k = 0; k < 3; ++k) {
      sums[t[k]].area += areas.back();
      sums[t[k]].corners += 1;
      turns[t[k]] += sums[t[(k + 1) % 3]].hash - sums[t[(k + 2) % 3]].hash;
      if (twice > 0) part.vertices[t[k]].add_plane((1 / twice) * n, 0.5 * twice);
    }
  }
  for (Sums& of : sums) of.area /= of.corners;
  const auto allowed = static_cast<float>(kEdgeOverArea * deviation * deviation / 3);
  part.budgets.assign(ids.size(), 0);
  for (std::size_t i = 0; i < areas.size(); ++i) {
    const auto& [a, b, c] = part.triangles[i];
    const float budget = allowed * (sums[a].area + sums[b].area + sums[c].area) * areas[i];
    for (const std::uint32_t v : {a, b, c}) part.budgets[v] += budget;
  }
  part.locked.resize(ids.size());
  for (std::size_t v = 0; v < ids.size(); ++v) part.locked[v] = turns[v] != 0 ? 1 : 0;
}
namespace {

constexpr std::size_t kInFlight = 8;  ///< blocks at most: they take memory
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

/// Blocks read one after the other, thinned out side by side, and joined one after the other.
class Thinner {
 public:
  Thinner(MeshBlocks& mesh, double deviation, std::size_t rows, const RunContext& run)
      : mesh_(mesh),
        run_(run),
        budget_(deviation),
        rows_(rows),
        tolerances_(find_tolerances(mesh)),
        seams_(mesh, tolerances_) {}

  SimplifyStats thin(const std::function<void(TriangleMesh)>& take) {
    using Piece = std::shared_ptr<Block>;
    const auto begin = [&](tbb::flow_control& flow) -> Piece {
      if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
      Piece block;
      if (read_ == mesh_.triangles()) {
        flow.stop();
        return block;
      }
      if (!spare_.try_pop(block)) block = std::make_shared<Block>();
      const std::size_t count = std::min<std::uint64_t>(rows_, mesh_.triangles() - read_);
      block->thin.read(mesh_, read_, count);
      read_ += count;
      block->last = read_ == mesh_.triangles();
      return block;
    };
    const auto thin = [&](const Piece& block) {
      block->thin.survey(budget_);
      const std::size_t before = block->thin.part.triangles.size();
      block->result = matchings_.local().thin(block->thin.part, tolerances_, run_);
      block->contractions = (before - block->result.triangles) / 2;
      return block;
    };
    const auto all = static_cast<std::int64_t>((mesh_.triangles() + rows_ - 1) / rows_);
    std::int64_t blocks = 0;
    SimplifyStats stats;
    const auto end = [&](const Piece& block) {
      stats.contractions += block->contractions;
      stats.deviation = std::max(stats.deviation, block->result.deviation);
      TriangleMesh piece = seams_.join(block->thin, block->last, run_);
      spare_.push(block);
      stats.triangles_after += piece.triangles.size();
      take(std::move(piece));
      ++blocks;
      if (run_.progress) run_.progress({"simplify", 0, 0, blocks, all});
    };
    const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
    tbb::parallel_pipeline(std::min(threads + 1, kInFlight),
                           tbb::make_filter<void, Piece>(tbb::filter_mode::serial_in_order, begin) &
                               tbb::make_filter<Piece, Piece>(tbb::filter_mode::parallel, thin) &
                               tbb::make_filter<Piece, void>(tbb::filter_mode::serial_in_order, end));
    stats.triangles_before = mesh_.triangles();
    stats.vertices_after = seams_.vertices_given();
    stats.contractions += seams_.contractions();
    stats.deviation = std::max(stats.deviation, seams_.deviation());
    stats.reached = true;
    return stats;
  }

 private:
  struct Block {
    ThinBlock thin;
    bool last = false;
    Matching::Result result;
    std::uint64_t contractions = 0;
  };

  MeshBlocks& mesh_;
  const RunContext& run_;
  double budget_;
  std::size_t rows_;
  std::vector<float> tolerances_;
  ThinSeams seams_;
  tbb::enumerable_thread_specific<Matching> matchings_;
  tbb::concurrent_queue<std::shared_ptr<Block>> spare_;  ///< blocks that are done: their memory
  std::uint64_t read_ = 0;                               ///< triangles
};

}  // namespace

std::size_t thin_block_of(std::uint64_t triangles) {
  constexpr double kSlabs = 16;  // square roots of the triangles: some slabs of a mesh that was streamed
  constexpr std::size_t kLeast = 1U << 15;
  const auto wanted = static_cast<std::size_t>(kSlabs * std::sqrt(static_cast<double>(triangles)));
  return std::bit_ceil(std::clamp(wanted, kLeast, kThinBlock));
}

SimplifyStats thin_blocks(MeshBlocks& mesh, double deviation, const std::function<void(TriangleMesh)>& take,
                          const RunContext& run, std::size_t block) {
  return Thinner(mesh, deviation, block > 0 ? block : thin_block_of(mesh.triangles()), run).thin(take);
}

}  // namespace lamina::simplify
