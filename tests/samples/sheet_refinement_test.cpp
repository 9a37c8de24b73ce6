#include "samples/sheet_refinement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <utility>

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

constexpr std::int64_t kAll = std::numeric_limits<std::int64_t>::max();

/// The levels that samples get which ask for these; radius 0: left out.
std::vector<std::uint8_t> levels_of(const LocalSamples& samples, std::vector<std::uint8_t> levels,
                                    const std::vector<float>& radius) {
  SheetRefinement sheets(kSheetLattice);
  sheets.push(samples, levels, radius);
  std::vector<std::uint8_t> finer;
  EXPECT_TRUE(sheets.pop(kAll, finer));
  for (std::size_t i = 0; i < levels.size(); ++i) levels[i] = static_cast<std::uint8_t>(levels[i] - finer[i]);
  return levels;
}

std::vector<std::uint8_t> levels_of(const LocalSamples& samples, std::uint8_t level) {
  return levels_of(samples, std::vector<std::uint8_t>(samples.size(), level), std::vector<float>(samples.size(), 900));
}

TEST(SheetRefinement, AWallOfHalfACellIsThin) {
  LocalSamples wall;
  add_sheet(200, 1, wall);
  add_sheet(700, -1, wall);
  for (const std::uint8_t level : levels_of(wall, 1)) EXPECT_EQ(level, 0);
}

TEST(SheetRefinement, OneSheetIsNotNorAreTwoThatLieThreeCellsApart) {
  LocalSamples wall;
  add_sheet(200, 1, wall);
  for (const std::uint8_t level : levels_of(wall, 1)) EXPECT_EQ(level, 1);
  add_sheet(3200, -1, wall);
  for (const std::uint8_t level : levels_of(wall, 1)) EXPECT_EQ(level, 1);
}

TEST(SheetRefinement, OnlyWhereBothSheetsAre) {
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

TEST(SheetRefinement, TheFinestLevelStaysAndLeftOutSamplesDoNotCount) {
  LocalSamples wall;
  add_sheet(200, 1, wall);
  add_sheet(700, -1, wall);
  for (const std::uint8_t level : levels_of(wall, 0)) EXPECT_EQ(level, 0);
  std::vector<float> radius(wall.size(), 900);
  std::fill(radius.begin() + 1600, radius.end(), 0.0F);
  const std::vector<std::uint8_t> levels = levels_of(wall, std::vector<std::uint8_t>(wall.size(), 1), radius);
  for (std::size_t i = 0; i < 1600; ++i) EXPECT_EQ(levels[i], 1);
}

/// Normals that agree the more the farther to the right they are; so many cells tall.
LocalSamples disagreeing_cloud(int count, std::uint32_t seed, double height) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<std::int32_t> at(-4 * kSheetSide, 4 * kSheetSide);
  std::normal_distribution<float> normal;
  LocalSamples cloud;
  for (int i = 0; i < count; ++i) {
    cloud.x.push_back(at(random));
    const float x = normal(random), y = normal(random);
    const float z = normal(random) + static_cast<float>(cloud.x.back()) / static_cast<float>(kSheetSide);
    const float length = std::hypot(x, y, z);
    cloud.y.push_back(at(random));
    cloud.z.push_back(static_cast<std::int32_t>(at(random) * height / 8));
    cloud.nx.push_back(x / length);
    cloud.ny.push_back(y / length);
    cloud.nz.push_back(z / length);
  }
  return cloud;
}

/// Oracle: every sample looks at all others.
TEST(SheetRefinement, AgreesWithLookingAtAllSamples) {
  const LocalSamples cloud = disagreeing_cloud(400, 3, 2);
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
    if (std::abs(share - kCancelledShare) < 1e-4) continue;
    EXPECT_EQ(levels[i], share < kCancelledShare ? 0 : 1) << i;
  }
}

/// Samples [first, end) in the order of z.
LocalSamples part_of(const LocalSamples& cloud, const std::vector<std::size_t>& by_z, std::size_t first,
                     std::size_t end) {
  LocalSamples part;
  for (std::size_t k = first; k < end; ++k) {
    const std::size_t i = by_z[k];
    for (const auto& [to, from] : {std::pair{&part.x, &cloud.x}, {&part.y, &cloud.y}, {&part.z, &cloud.z}})
      to->push_back((*from)[i]);
    for (const auto& [to, from] : {std::pair{&part.nx, &cloud.nx}, {&part.ny, &cloud.ny}, {&part.nz, &cloud.nz}})
      to->push_back((*from)[i]);
  }
  return part;
}

/// However the cloud is cut, and as soon as a bucket can be told; levels of all kinds mixed.
TEST(SheetRefinement, DoesNotDependOnWhereBucketsAreCut) {
  const LocalSamples cloud = disagreeing_cloud(3000, 5, 20);
  std::vector<std::size_t> by_z(cloud.size());
  std::iota(by_z.begin(), by_z.end(), std::size_t{0});
  std::stable_sort(by_z.begin(), by_z.end(), [&](auto a, auto b) { return cloud.z[a] < cloud.z[b]; });
  const auto level_of = [&](std::size_t i) { return static_cast<std::uint8_t>(i % 3); };
  std::vector<std::uint8_t> wanted(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) wanted[i] = level_of(i);
  const std::vector<std::uint8_t> whole = levels_of(cloud, wanted, std::vector<float>(cloud.size(), 900));
  EXPECT_NE(whole, wanted);
  for (const std::size_t size : {1U, 7U, 100U, 1111U}) {
    SheetRefinement sheets(kSheetLattice);
    std::vector<std::uint8_t> finer;
    std::size_t popped = 0;
    std::size_t most_waiting = 0;
    const auto pop_all = [&](std::int64_t pushed_below) {
      while (sheets.pop(pushed_below, finer)) {
        for (const bool takes_less : finer) {
          const std::size_t i = by_z[popped++];
          ASSERT_EQ(whole[i], wanted[i] - (takes_less ? 1 : 0)) << size;
        }
      }
    };
    for (std::size_t first = 0; first < cloud.size(); first += size) {
      const std::size_t end = std::min(cloud.size(), first + size);
      std::vector<std::uint8_t> level;
      for (std::size_t k = first; k < end; ++k) level.push_back(wanted[by_z[k]]);
      sheets.push(part_of(cloud, by_z, first, end), level, std::vector<float>(level.size(), 900));
      most_waiting = std::max(most_waiting, end - popped);
      pop_all(end < cloud.size() ? cloud.z[by_z[end]] : kAll);
    }
    EXPECT_EQ(popped, cloud.size());
    // Two cells of the coarsest level are waited for, not all.
    if (size < 100) {
      EXPECT_LT(most_waiting, cloud.size());
    }
  }
}

}  // namespace
}  // namespace lamina
