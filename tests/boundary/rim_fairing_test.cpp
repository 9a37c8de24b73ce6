#include "boundary/rim_fairing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "boundary/grid_slabs.h"

namespace lamina {
namespace {

using test::in_disc;
using test::kSide;
using test::squares;

std::vector<MeshSlab> faired(std::vector<MeshSlab> slabs) {
  return test::passed(RimFairer(), std::move(slabs));
}

using Place = std::array<double, 3>;

/// Slabs of grid_slabs() have kSide vertices each.
Place place(const std::vector<MeshSlab>& slabs, std::uint32_t v) {
  const VertexBatch& batch = slabs[v / kSide].vertices;
  const std::size_t i = v % kSide;
  return {batch.x[i], batch.y[i], batch.z[i]};
}

/// Twice the area seen from above, negative where the triangle lies on its face.
double area(const std::vector<MeshSlab>& slabs, const std::array<std::uint32_t, 3>& t) {
  const Place a = place(slabs, t[0]);
  const Place b = place(slabs, t[1]);
  const Place c = place(slabs, t[2]);
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/// Which corners of the grid have squares around, but not four.
bool on_rim(const test::WantedSquare& wanted, int i, int row) {
  const auto has = [&](int x, int y) {
    return x >= 0 && y >= 0 && x + 1 < kSide && y + 1 < kSide && wanted(x, y) ? 1 : 0;
  };
  const int around = has(i, row) + has(i - 1, row) + has(i, row - 1) + has(i - 1, row - 1);
  return around > 0 && around < 4;
}

TEST(RimFairer, StairsAroundADiscBecomeACircle) {
  const std::vector<MeshSlab> before = squares(in_disc);
  const std::vector<MeshSlab> after = faired(before);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t s = 0; s < after.size(); ++s) EXPECT_EQ(after[s].slab, before[s].slab);
  // How far the rim's vertices lie beside the circle of their mean radius, before and after.
  const auto spread = [](const std::vector<MeshSlab>& slabs) {
    double sum = 0, squares = 0, n = 0;
    for (int row = 0; row < kSide; ++row) {
      for (int i = 0; i < kSide; ++i) {
        if (!on_rim(in_disc, i, row)) continue;
        const Place p = place(slabs, static_cast<std::uint32_t>(row * kSide + i));
        const double r = std::hypot(p[0] - kSide / 2.0, p[1] - kSide / 2.0);
        sum += r;
        squares += r * r;
        ++n;
      }
    }
    return std::sqrt(squares / n - sum / n * (sum / n));
  };
  EXPECT_LT(spread(after), 0.6 * spread(before));
}

/// The vertices' normals, straight up, are not those of the surface: noise turns them.
TEST(RimFairer, InsideAndSurfaceStay) {
  std::vector<MeshSlab> before = squares(in_disc);
  for (MeshSlab& slab : before) {
    for (std::size_t i = 0; i < slab.vertices.size(); ++i) slab.vertices.z[i] = 0.5 * slab.vertices.x[i];
  }
  const std::vector<MeshSlab> after = faired(before);
  int moved = 0;
  for (int row = 0; row < kSide; ++row) {
    for (int i = 0; i < kSide; ++i) {
      const auto v = static_cast<std::uint32_t>(row * kSide + i);
      const Place was = place(before, v);
      const Place is = place(after, v);
      EXPECT_NEAR(is[2], 0.5 * is[0], 1e-6);
      moved += was != is;
      if (!on_rim(in_disc, i, row)) {
        EXPECT_EQ(was, is) << i << ' ' << row;
      }
    }
  }
  EXPECT_GT(moved, 40);
}

TEST(RimFairer, NoTriangleTurnsOver) {
  std::minstd_rand random(7);
  for (int round = 0; round < 20; ++round) {
    std::vector<bool> wanted(kSide * kSide);
    for (std::size_t k = 0; k < wanted.size(); ++k) wanted[k] = random() % 8 != 0;
    std::vector<MeshSlab> slabs =
        squares([&](int i, int row) { return wanted[static_cast<std::size_t>(row * kSide + i)]; });
    // Narrow triangles, too, as cuts leave them.
    for (MeshSlab& s : slabs) {
      for (double& x : s.vertices.x) x += 0.45 * std::uniform_real_distribution<double>(-1, 1)(random);
    }
    const std::vector<MeshSlab> after = faired(slabs);
    for (std::size_t s = 0; s < slabs.size(); ++s) {
      for (const auto& t : slabs[s].triangles) {
        if (area(slabs, t) > 0) {
          EXPECT_GT(area(after, t), 0);
        }
      }
    }
  }
}

TEST(RimFairer, DoesNotDependOnTheOrderOfTriangles) {
  std::vector<MeshSlab> slabs = squares(in_disc);
  const std::vector<MeshSlab> before = faired(slabs);
  for (MeshSlab& s : slabs) {
    std::reverse(s.triangles.begin(), s.triangles.end());
    for (auto& t : s.triangles) std::rotate(t.begin(), t.begin() + 1, t.end());
  }
  const std::vector<MeshSlab> after = faired(slabs);
  for (std::size_t s = 0; s < before.size(); ++s) {
    EXPECT_EQ(before[s].vertices.x, after[s].vertices.x);
    EXPECT_EQ(before[s].vertices.y, after[s].vertices.y);
  }
}

/// A rim that is changed farther away than the steps reach changes nothing here.
TEST(RimFairer, DependsOnTheSlabsBesideAlone) {
  constexpr int kChanged = 12;
  const auto notched = [](int i, int row) { return in_disc(i, row) && (row >= kChanged || i % 3 != 0); };
  const std::vector<MeshSlab> one = faired(squares(in_disc));
  const std::vector<MeshSlab> other = faired(squares(notched));
  for (std::size_t s = kChanged + kFairingSteps + 1; s < one.size(); ++s) {
    EXPECT_EQ(one[s].vertices.x, other[s].vertices.x) << s;
    EXPECT_EQ(one[s].vertices.y, other[s].vertices.y) << s;
  }
  EXPECT_NE(one[kChanged].vertices.y, other[kChanged].vertices.y);
}

}  // namespace
}  // namespace lamina
