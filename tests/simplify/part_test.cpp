#include "simplify/part.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "lamina/mesh.h"
#include "simplify/stars.h"

namespace lamina::simplify {
namespace {

/// n x n squares of a gentle wave.
TriangleMesh wave(std::uint32_t n) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t j = 0; j <= n; ++j) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      mesh.positions.push_back({x, y, 0.1 * std::sin(6 * x) * std::cos(5 * y)});
    }
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
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
  const PartResult result = simplify_part(mesh, locked, 10'000, {});
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
  const PartResult result = simplify_part(mesh, std::vector<std::uint8_t>(mesh.positions.size(), 1), 10, {});
  EXPECT_EQ(mesh.triangles.size(), there);
  EXPECT_EQ(result.deviation, 0);
}

}  // namespace
}  // namespace lamina::simplify
