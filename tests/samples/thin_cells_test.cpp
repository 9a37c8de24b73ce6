#include "samples/thin_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace lamina {
namespace {

constexpr std::int32_t kSheetSide = 1000;  ///< of a cell of level 1
const Lattice kSheetLattice{kSheetSide / 2, 4};

/// A square of 20 x 20 cells at a height, four samples a cell; of x and y from somewhere on.
void add_sheet(std::int32_t z, float facing, LocalSamples& out, std::int32_t from = 0) {
  std::mt19937 random(7);
  std::uniform_int_distribution<std::int32_t> at(0, 20 * kSheetSide - 1);
  for (int i = 0; i < 1600; ++i) {
    const std::int32_t x = at(random), y = at(random);
    if (std::min(x, y) < from) continue;
    out.x.push_back(x);
    out.y.push_back(y);
    out.z.push_back(z);
    out.nx.push_back(0);
    out.ny.push_back(0);
    out.nz.push_back(facing);
  }
}

std::vector<std::uint8_t> levels_of(const LocalSamples& samples, std::uint8_t level, float radius = 900) {
  std::vector<std::uint8_t> levels(samples.size(), level);
  refine_thin(kSheetLattice, samples, std::vector<float>(samples.size(), radius), levels);
  return levels;
}

TEST(ThinCells, AWallOfHalfACellIsThin) {
  LocalSamples wall;
  add_sheet(200, 1, wall);
  add_sheet(700, -1, wall);
  for (const std::uint8_t level : levels_of(wall, 1)) EXPECT_EQ(level, 0);
}

TEST(ThinCells, OneSheetIsNotNorAreTwoThatLieThreeCellsApart) {
  LocalSamples wall;
  add_sheet(200, 1, wall);
  for (const std::uint8_t level : levels_of(wall, 1)) EXPECT_EQ(level, 1);
  add_sheet(3200, -1, wall);
  for (const std::uint8_t level : levels_of(wall, 1)) EXPECT_EQ(level, 1);
}

TEST(ThinCells, OnlyWhereBothSheetsAre) {
  LocalSamples wall;
  add_sheet(200, 1, wall);
  add_sheet(700, -1, wall, 10 * kSheetSide);
  const std::vector<std::uint8_t> levels = levels_of(wall, 1);
  for (std::size_t i = 0; i < 1600; ++i) {
    const std::int32_t nearest = std::min(wall.x[i], wall.y[i]);
    if (nearest >= 12 * kSheetSide) {
      EXPECT_EQ(levels[i], 0);
    } else if (nearest < 9 * kSheetSide) {
      EXPECT_EQ(levels[i], 1);
    }
  }
}

TEST(ThinCells, TheFinestLevelStaysAndLeftOutSamplesDoNotCount) {
  LocalSamples wall;
  add_sheet(200, 1, wall);
  add_sheet(700, -1, wall);
  for (const std::uint8_t level : levels_of(wall, 0)) EXPECT_EQ(level, 0);
  std::vector<std::uint8_t> levels(wall.size(), 1);
  std::vector<float> radius(wall.size(), 900);
  std::fill(radius.begin() + 1600, radius.end(), 0.0F);
  refine_thin(kSheetLattice, wall, radius, levels);
  for (std::size_t i = 0; i < 1600; ++i) EXPECT_EQ(levels[i], 1);
}

/// Oracle: every sample looks at all others.
TEST(ThinCells, AgreesWithLookingAtAllSamples) {
  std::mt19937 random(3);
  std::uniform_int_distribution<std::int32_t> at(-4 * kSheetSide, 4 * kSheetSide);
  std::normal_distribution<float> normal;
  LocalSamples cloud;
  for (int i = 0; i < 400; ++i) {
    cloud.x.push_back(at(random));
    // The farther to the right, the more they agree.
    const float x = normal(random), y = normal(random);
    const float z = normal(random) + static_cast<float>(cloud.x.back()) / static_cast<float>(kSheetSide);
    const float length = std::hypot(x, y, z);
    cloud.y.push_back(at(random));
    cloud.z.push_back(at(random) / 4);
    cloud.nx.push_back(x / length);
    cloud.ny.push_back(y / length);
    cloud.nz.push_back(z / length);
  }
  const std::vector<std::uint8_t> levels = levels_of(cloud, 1);
  EXPECT_GT(std::accumulate(levels.begin(), levels.end(), 0), 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const auto near = [&](const std::vector<std::int32_t>& v, std::size_t j) {
      return std::abs(floor_div(v[i], kSheetSide) - floor_div(v[j], kSheetSide)) <= 1;
    };
    double x = 0, y = 0, z = 0, count = 0;
    for (std::size_t j = 0; j < cloud.size(); ++j) {
      if (!near(cloud.x, j) || !near(cloud.y, j) || !near(cloud.z, j)) continue;
      x += static_cast<double>(cloud.nx[j]);
      y += static_cast<double>(cloud.ny[j]);
      z += static_cast<double>(cloud.nz[j]);
      ++count;
    }
    const double share = std::hypot(x, y, z) / count;
    if (std::abs(share - static_cast<double>(kThin)) < 1e-4) continue;
    EXPECT_EQ(levels[i], share < static_cast<double>(kThin) ? 0 : 1) << i;
  }
}

}  // namespace
}  // namespace lamina
