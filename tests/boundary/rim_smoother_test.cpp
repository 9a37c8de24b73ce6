#include "boundary/rims.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "boundary/grid_slabs.h"

namespace lamina {
namespace {

using test::in_disc;
using test::kSide;
using test::squares;

constexpr float kCutLevel = 0.2F;

std::vector<MeshSlab> smoothed(std::vector<MeshSlab> slabs) {
  return test::passed(RimSmoother(kCutLevel), std::move(slabs));
}

float overhang_at(const std::vector<MeshSlab>& slabs, int i, int row) {
  return slabs[static_cast<std::size_t>(row)].vertices.overhang[static_cast<std::size_t>(i)];
}

TEST(RimSmoother, RaisesTheEndsOfASurfaceAndLeavesItsInside) {
  const std::vector<MeshSlab> out = smoothed(squares(in_disc));
  ASSERT_EQ(out.size(), std::size_t{kSide});
  for (int row = 0; row < kSide; ++row) EXPECT_EQ(out[static_cast<std::size_t>(row)].slab, row);
  for (int row = 1; row + 1 < kSide; ++row) {
    for (int i = 1; i + 1 < kSide; ++i) {
      const int around = in_disc(i, row) + in_disc(i - 1, row) + in_disc(i, row - 1) + in_disc(i - 1, row - 1);
      const double from_middle = std::hypot(i - kSide / 2.0, row - kSide / 2.0);
      if (around == 2 || around == 3) {  // one square alone: a corner without a neighbour inside
        EXPECT_GT(overhang_at(out, i, row), 0.6F * kCutLevel) << i << ' ' << row;
      } else if (from_middle < 12) {
        EXPECT_EQ(overhang_at(out, i, row), 0) << i << ' ' << row;
      }
    }
  }
}

TEST(RimSmoother, ABridgeWithoutAnInsideStays) {
  const auto disc_and_bridge = [](int i, int row) { return in_disc(i, row) || row == kSide / 2; };
  const std::vector<MeshSlab> out = smoothed(squares(disc_and_bridge));
  for (const int row : {kSide / 2, kSide / 2 + 1}) EXPECT_EQ(overhang_at(out, kSide - 3, row), 0);
}

TEST(RimSmoother, DoesNotDependOnTheOrderOfTriangles) {
  std::vector<MeshSlab> slabs = squares(in_disc);
  const std::vector<MeshSlab> before = smoothed(slabs);
  for (MeshSlab& s : slabs) {
    std::reverse(s.triangles.begin(), s.triangles.end());
    for (auto& t : s.triangles) std::rotate(t.begin(), t.begin() + 1, t.end());
  }
  const std::vector<MeshSlab> after = smoothed(slabs);
  for (std::size_t s = 0; s < before.size(); ++s) EXPECT_EQ(before[s].vertices.overhang, after[s].vertices.overhang);
}

}  // namespace
}  // namespace lamina
