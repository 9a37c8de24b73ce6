#include "volume/volume_data.h"

#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <algorithm>
#include <cmath>

namespace lamina::volume {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;

constexpr float kBand = 3;
const openvdb::CoordBBox kSheet(Coord(0, 0, -8), Coord(23, 39, 7));

/// A square sheet in the middle of two layers of leaves, inside below; nothing is known beyond its edge.
FloatGrid::Ptr sheet() {
  openvdb::initialize();
  auto grid = FloatGrid::create(kBand);
  for (auto at = kSheet.begin(); at; ++at) {
    const auto z = static_cast<float>((*at).z());
    grid->tree().setValueOn(*at, std::clamp(z, -kBand, kBand));
    if (std::abs(z) >= kBand) grid->tree().setValueOff(*at);
  }
  return grid;
}

void expect_inside_the_band_only(const FloatGrid& grid, const openvdb::CoordBBox& where) {
  for (auto at = where.begin(); at; ++at) {
    const bool inside = kSheet.isInside(*at) && (*at).z() < 0 && (*at).z() > -3;
    ASSERT_EQ(grid.tree().getValue(*at) < 0, inside) << *at;
  }
}

TEST(OpenInside, BehindASheetIsOutside) {
  const auto grid = sheet();
  empty_open_inside(*grid);
  expect_inside_the_band_only(*grid, {Coord(-8, -8, -32), Coord(40, 56, 24)});
}

TEST(OpenInside, TilesBehindASheetAreOutside) {
  const auto grid = sheet();
  for (int x = 0; x < 24; x += 8)
    for (int y = 8; y < 32; y += 8) grid->tree().addTile(1, Coord(x, y, -16), -kBand, false);
  grid->tree().addTile(2, Coord(0, 0, -256), -kBand, false);
  grid->tree().addTile(1, Coord(8, 16, -24), -kBand, false);
  empty_open_inside(*grid);
  expect_inside_the_band_only(*grid, {Coord(-8, -8, -32), Coord(40, 56, 24)});
  EXPECT_GT(grid->tree().getValue(Coord(5, 5, -200)), 0);
}

TEST(OpenInside, WhatIsEnclosedStays) {
  openvdb::initialize();
  const auto sphere = openvdb::tools::createLevelSetSphere<FloatGrid>(60, {3, 5, 7}, 1);
  const FloatGrid::Ptr copy = sphere->deepCopy();
  empty_open_inside(*copy);
  EXPECT_TRUE(copy->tree().hasSameTopology(sphere->tree()));
  for (auto value = sphere->tree().cbeginValueAll(); value; ++value)
    ASSERT_EQ(copy->tree().getValue(value.getCoord()), *value) << value.getCoord();
}

TEST(OpenInside, OnlyWhatIsConnectedWithTheOutside) {
  const auto grid = sheet();
  const auto sphere = openvdb::tools::createLevelSetSphere<FloatGrid>(30, {100, 0, 0}, 1);
  const FloatGrid::Ptr before = sphere->deepCopy();
  openvdb::tree::ValueAccessor<FloatGrid::TreeType> to(grid->tree());
  for (auto value = sphere->tree().cbeginValueAll(); value; ++value) {
    if (!value.isVoxelValue()) {
      if (*value < 0) grid->tree().addTile(value.getLevel(), value.getCoord(), *value, false);
      continue;
    }
    to.setValue(value.getCoord(), *value);
    if (!value.isValueOn()) to.setValueOff(value.getCoord());
  }
  empty_open_inside(*grid);
  expect_inside_the_band_only(*grid, {Coord(-8, -8, -32), Coord(40, 56, 24)});
  for (const int r : {0, 10, 20, 26, 29}) EXPECT_LT(grid->tree().getValue(Coord(100, r, 0)), 0) << r;
  for (const int r : {31, 34, 45}) EXPECT_GT(grid->tree().getValue(Coord(100, r, 0)), 0) << r;
}

}  // namespace
}  // namespace lamina::volume
