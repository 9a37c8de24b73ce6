#include "simplify/thin_block.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/hashing.h"
#include "lamina/error.h"
#include "measure/edge_table.h"
#include "meshes/mesh_pieces.h"
#include "meshes/vec3.h"

namespace lamina::simplify {

using namespace meshes;

namespace {
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

}  // namespace lamina::simplify
