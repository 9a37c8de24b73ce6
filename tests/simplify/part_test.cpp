#include "simplify/matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/simplify.h"
#include "simplify/height_field.h"
#include "simplify/stars.h"

namespace lamina::simplify {
namespace {

/// n x n squares of a gentle wave.
TriangleMesh wave(std::uint32_t n) {
  TriangleMesh mesh = test::height_field(n, [](double x, double y) { return 0.1 * std::sin(6 * x) * std::cos(5 * y); });
  return mesh;
}

TEST(SimplifyPart, LockedVerticesStay) {
  constexpr std::uint32_t kSide = 200;
  TriangleMesh mesh = wave(kSide);
  const TriangleMesh before = mesh;
  std::vector<std::uint8_t> locked(mesh.positions.size(), 0);
  for (std::uint32_t v = 0; v < locked.size(); ++v) {
    const std::uint32_t i = v / (kSide + 1), j = v % (kSide + 1);
    if (i == 0 || j == 0 || i == kSide) locked[v] = 1;  // one side is free
  }
  const PartResult result = PartSimplifier().simplify(mesh, locked, 10'000, {});
  EXPECT_LE(mesh.triangles.size(), 10'100U);
  EXPECT_GT(result.deviation, 0);
  EXPECT_LT(result.deviation, 1e-3);
  std::size_t free_rim = 0;
  for (std::uint32_t v = 0; v < locked.size(); ++v) {
    if (locked[v] == 0) {
      free_rim += v % (kSide + 1) == kSide && result.numbers[v] != kNone ? 1 : 0;
      continue;
    }
    ASSERT_NE(result.numbers[v], kNone);
    ASSERT_EQ(mesh.positions[result.numbers[v]], before.positions[v]);
  }
  EXPECT_LT(free_rim, kSide / 2);
}

TEST(SimplifyPart, EndsWhereEverythingIsLocked) {
  TriangleMesh mesh = wave(60);
  const std::size_t there = mesh.triangles.size();
  const std::vector<std::uint8_t> locked(mesh.positions.size(), 1);
  const PartResult result = PartSimplifier().simplify(mesh, locked, 10, {});
  EXPECT_EQ(mesh.triangles.size(), there);
  EXPECT_EQ(result.deviation, 0);
}

// A simplifier keeps its memory, nothing of the meshes that it had before.
TEST(SimplifyPart, OneAfterTheOtherAsEachAlone) {
  PartSimplifier simplifier;
  for (const std::uint32_t side : {90U, 40U, 70U}) {
    TriangleMesh first = wave(side), second = first;
    std::vector<std::uint8_t> locked(first.positions.size(), 0);
    locked[side] = 1;
    const PartResult a = simplifier.simplify(first, locked, 900, {}),
                     b = PartSimplifier().simplify(second, locked, 900, {});
    EXPECT_EQ(a.deviation, b.deviation);
    EXPECT_EQ(a.numbers, b.numbers);
    EXPECT_EQ(first.positions, second.positions);
    EXPECT_EQ(first.triangles, second.triangles);
  }
}

TEST(Stars, ContractionsAreTakenBack) {
  const TriangleMesh mesh = wave(12);
  Stars stars(mesh.triangles, mesh.positions.size());
  struct Step {
    std::uint32_t u, v;
    Stars::Before before;
  };
  std::vector<Step> steps;
  for (std::uint32_t v = 0; v < mesh.positions.size(); v += 3) {
    std::vector<std::uint32_t> near;
    stars.neighbours(v, near);
    for (const std::uint32_t u : near) {
      if (!stars.contractible(u, v)) continue;
      steps.push_back({u, v, stars.before(u, v)});
      EXPECT_EQ(stars.contract(u, v), static_cast<int>(steps.back().before.dead));
      break;
    }
  }
  ASSERT_GT(steps.size(), 40U);
  for (std::size_t i = steps.size(); i-- > 0;) stars.revert(steps[i].u, steps[i].v, steps[i].before);
  EXPECT_EQ(stars.triangles(), mesh.triangles);
  Stars fresh(mesh.triangles, mesh.positions.size());
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    const auto is = stars.around(v), was = fresh.around(v);
    EXPECT_TRUE(std::is_permutation(is.begin(), is.end(), was.begin(), was.end())) << v;
    EXPECT_EQ(stars.boundary(v), fresh.boundary(v)) << v;
  }
}

// No queue over all edges, and yet hardly farther from the mesh than with one.
TEST(SimplifyPart, NearlyAsCloseAsContractionsInOrder) {
  const auto root_mean_square = [](const TriangleMesh& mesh) {
    double sum = 0;
    for (const auto& t : mesh.triangles) {
      std::array<double, 3> middle{};
      for (const std::uint32_t v : t)
        for (std::size_t k = 0; k < 3; ++k) middle[k] += mesh.positions[v][k] / 3;
      const double off = middle[2] - 0.1 * std::sin(6 * middle[0]) * std::cos(5 * middle[1]);
      sum += off * off;
    }
    return std::sqrt(sum / static_cast<double>(mesh.triangles.size()));
  };
  TriangleMesh passes = wave(200), in_order = passes;
  PartSimplifier().simplify(passes, std::vector<std::uint8_t>(passes.positions.size(), 0), 10'000, {});
  SimplifySettings settings;
  settings.triangles = 10'000;
  simplify_mesh(in_order, settings);
  EXPECT_LE(passes.triangles.size(), 10'000U);
  EXPECT_LT(root_mean_square(passes), 1.15 * root_mean_square(in_order));
}

}  // namespace
}  // namespace lamina::simplify
