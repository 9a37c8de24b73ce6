#include "boundary/rims.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "boundary/grid_slabs.h"

namespace lamina {
namespace {

using Field = std::function<float(double, double)>;

std::vector<MeshSlab> grid(int side, const Field& overhang) {
  std::vector<MeshSlab> slabs = test::grid_slabs(side, overhang);
  for (MeshSlab& slab : slabs) {
    slab.vertices.attributes.emplace_back(slab.vertices.x.begin(), slab.vertices.x.end());
    slab.vertices.radius.assign(slab.vertices.size(), 2);
  }
  return slabs;
}

struct Trimmed {
  std::vector<double> x, y;
  std::vector<float> attribute;
  std::vector<std::array<std::uint32_t, 3>> triangles;

  [[nodiscard]] double area() const {
    double sum = 0;
    for (const auto& t : triangles) sum += area_of(t);
    return sum;
  }
  [[nodiscard]] double area_of(const std::array<std::uint32_t, 3>& t) const {
    return 0.5 * ((x[t[1]] - x[t[0]]) * (y[t[2]] - y[t[0]]) - (x[t[2]] - x[t[0]]) * (y[t[1]] - y[t[0]]));
  }
  /// How many triangles each edge has on its left, by its ends.
  [[nodiscard]] std::map<std::pair<std::uint32_t, std::uint32_t>, int> half_edges() const {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> out;
    for (const auto& t : triangles) {
      for (std::size_t k = 0; k < 3; ++k) ++out[{t[k], t[(k + 1) % 3]}];
    }
    return out;
  }
};

Trimmed trim(std::vector<MeshSlab> slabs, float level) {
  RimTrimmer trimmer(level);
  Trimmed out;
  MeshSlab slab;
  std::int64_t expected = 0;
  const auto take = [&] {
    while (trimmer.pop(slab)) {
      EXPECT_EQ(slab.slab, expected++);
      out.x.insert(out.x.end(), slab.vertices.x.begin(), slab.vertices.x.end());
      out.y.insert(out.y.end(), slab.vertices.y.begin(), slab.vertices.y.end());
      out.attribute.insert(out.attribute.end(), slab.vertices.attributes[0].begin(), slab.vertices.attributes[0].end());
      for (const auto& t : slab.triangles) {
        for (const std::uint32_t v : t) EXPECT_LT(v, out.x.size()) << "a triangle waits for its vertices";
        out.triangles.push_back(t);
      }
    }
  };
  for (MeshSlab& s : slabs) {
    trimmer.push(std::move(s));
    take();
  }
  trimmer.finish();
  take();
  return out;
}

void expect_manifold(const Trimmed& m) {
  std::vector<bool> used(m.x.size(), false);
  for (const auto& t : m.triangles) {
    EXPECT_GT(m.area_of(t), 0) << "turned, or without area";
    for (const std::uint32_t v : t) used[v] = true;
  }
  EXPECT_EQ(std::count(used.begin(), used.end(), false), 0) << "vertices without triangles";
  for (const auto& [edge, count] : m.half_edges()) EXPECT_EQ(count, 1);
}

TEST(RimTrimmer, NothingBeyondTheLevelStaysAsItIs) {
  const std::vector<MeshSlab> slabs = grid(8, [](double, double) { return 0.1F; });
  const Trimmed m = trim(slabs, 0.25F);
  EXPECT_EQ(m.x.size(), 64u);
  EXPECT_NEAR(m.area(), 49, 1e-12);
  expect_manifold(m);
}

TEST(RimTrimmer, EverythingBeyondItGoes) {
  const Trimmed m = trim(grid(8, [](double, double) { return 0.5F; }), 0.25F);
  EXPECT_TRUE(m.x.empty() && m.triangles.empty());
}

TEST(RimTrimmer, CutsAlongAStraightLineAndInterpolates) {
  // Linear in x: the level is x = 4.3.
  const Trimmed m = trim(grid(10, [](double x, double) { return static_cast<float>(0.25 + 0.1 * (x - 4.3)); }), 0.25F);
  EXPECT_NEAR(m.area(), 4.3 * 9, 1e-4);
  expect_manifold(m);
  for (std::size_t i = 0; i < m.x.size(); ++i) {
    EXPECT_LE(m.x[i], 4.3 + 1e-4);
    EXPECT_NEAR(m.attribute[i], m.x[i], 1e-4);
  }
}

TEST(RimTrimmer, ADiscHasARoundRim) {
  const Trimmed m = trim(
      grid(41,
           [](double x, double y) { return static_cast<float>(0.25 + 0.05 * (std::hypot(x - 20, y - 20) - 15.2)); }),
      0.25F);
  expect_manifold(m);
  const double pi = std::acos(-1.0);
  EXPECT_NEAR(m.area(), pi * 15.2 * 15.2, 3);
  double length = 0;
  const auto edges = m.half_edges();
  for (const auto& [edge, count] : edges) {
    if (!edges.contains({edge.second, edge.first}))
      length += std::hypot(m.x[edge.first] - m.x[edge.second], m.y[edge.first] - m.y[edge.second]);
  }
  EXPECT_NEAR(length, 2 * pi * 15.2, 0.01 * 2 * pi * 15.2) << "whole triangles would be a quarter longer";
}

}  // namespace
}  // namespace lamina
