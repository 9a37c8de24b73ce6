// Boundary loops of streamed meshes; the truth is the whole mesh in memory.
#include "boundary/boundary.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <random>
#include <set>

#include "support/mesh_check.h"

namespace lamina::boundary {
namespace {

struct Rows {
  std::vector<VertexBatch> vertices;
  std::vector<BoundaryFinder::Triangles> triangles;
  std::vector<std::uint64_t> first;
};

/// A sheet of rows of vertices, each row a slab; a share of its triangles is missing.
Rows ragged_sheet(std::mt19937& random, std::uint32_t rows, std::uint32_t columns, double missing) {
  std::uniform_real_distribution<> uniform;
  Rows out;
  for (std::uint32_t r = 0; r < rows; ++r) {
    VertexBatch v;
    for (std::uint32_t c = 0; c < columns; ++c) {
      v.x.push_back(c), v.y.push_back(r), v.z.push_back(0);
      v.nx.push_back(0), v.ny.push_back(0), v.nz.push_back(1);
      v.radius.push_back(1);
    }
    BoundaryFinder::Triangles t;
    for (std::uint32_t c = 0; r > 0 && c + 1 < columns; ++c) {
      const std::uint32_t d = r * columns + c, b = d - columns;
      if (uniform(random) >= missing) t.push_back({b, b + 1, d});
      if (uniform(random) >= missing) t.push_back({b + 1, d + 1, d});
    }
    out.vertices.push_back(v);
    out.triangles.push_back(t);
    out.first.push_back(r * columns);
  }
  return out;
}

using Edges = std::set<std::pair<Number, Number>>;

Edges true_rims(const Rows& rows) {
  test::Triangles all;
  for (const auto& t : rows.triangles) all.insert(all.end(), t.begin(), t.end());
  Edges edges;
  if (all.empty()) return edges;
  for (const auto& e : test::check_mesh(all).boundary) edges.insert({e[0], e[1]});
  return edges;
}

Edges ends(const std::vector<BoundaryEdge>& edges, Number first = 0) {
  Edges out;
  for (const BoundaryEdge& e : edges) out.insert({e.from + first, e.to + first});
  return out;
}

RC_GTEST_PROP(BoundaryFinder, FindsWhatTheWholeMeshShows, ()) {
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  const auto rows = *rc::gen::inRange<std::uint32_t>(1, 8);
  const Rows sheet =
      ragged_sheet(random, rows, *rc::gen::inRange<std::uint32_t>(2, 9), *rc::gen::element(0.0, 0.1, 0.6));
  BoundaryFinder finder;
  BoundaryBatch batch;
  for (std::size_t r = 0; r < rows; ++r) finder.add(sheet.vertices[r], sheet.triangles[r], batch);
  finder.finish(false, batch);
  const Edges truth = true_rims(sheet);
  RC_ASSERT(ends(batch.edges) == truth);
  RC_ASSERT(batch.edges.size() == truth.size());
  RC_ASSERT(batch.loose.empty());
  std::set<Number> listed;
  for (const BoundaryVertex& v : batch.vertices) RC_ASSERT(listed.insert(v.number).second);
  for (const auto& [from, to] : truth) RC_ASSERT(listed.contains(from) && listed.contains(to));
  for (const InnerEdge& e : batch.inner) RC_ASSERT(!truth.contains({e.a, e.b}) && !truth.contains({e.b, e.a}));
}

RC_GTEST_PROP(BoundaryFinder, PartsHaveTheSameRimsOnceTheirLooseEdgesHaveMet, ()) {
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  const auto rows = *rc::gen::inRange<std::uint32_t>(2, 9);
  const Rows sheet = ragged_sheet(random, rows, 6, *rc::gen::element(0.0, 0.15, 0.6));
  const auto cut = *rc::gen::inRange<std::uint32_t>(1, rows);
  BoundaryBatch lower, upper;
  BoundaryFinder below;
  for (std::size_t r = 0; r < cut; ++r) below.add(sheet.vertices[r], sheet.triangles[r], lower);
  below.finish(true, lower);
  BoundaryFinder above(sheet.first[cut], sheet.vertices[cut - 1]);
  for (std::size_t r = cut; r < rows; ++r) above.add(sheet.vertices[r], sheet.triangles[r], upper);
  above.finish(false, upper);
  const auto shift = static_cast<Number>(sheet.first[cut]);
  Edges all = ends(lower.edges);
  all.merge(ends(upper.edges, shift));
  const Edges one = ends(lower.loose), two = ends(upper.loose, shift);
  for (const auto& [from, to] : one) {
    if (!two.contains({to, from})) all.insert({from, to});
  }
  for (const auto& [from, to] : two) {
    if (!one.contains({to, from})) all.insert({from, to});
  }
  RC_ASSERT(all == true_rims(sheet));
}

TEST(BoundaryFinder, TellsTheNormalOfTheTriangleBeside) {
  std::mt19937 random(1);
  const Rows sheet = ragged_sheet(random, 3, 3, 0);
  BoundaryFinder finder;
  BoundaryBatch batch;
  for (std::size_t r = 0; r < 3; ++r) finder.add(sheet.vertices[r], sheet.triangles[r], batch);
  finder.finish(false, batch);
  EXPECT_EQ(batch.edges.size(), 8U);
  for (const BoundaryEdge& e : batch.edges) EXPECT_EQ(e.normal, (std::array<double, 3>{0, 0, 1}));
}

}  // namespace
}  // namespace lamina::boundary
