// Vertices that would be written at one position, moved apart slab by slab; a set of written positions is the oracle.
#include "meshes/distinct_positions.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <set>
#include <vector>

namespace lamina {
namespace {

using Position = std::array<double, 3>;

/// As a file holds it; 0 and -0 are one.
Position written(const VertexBatch& v, std::size_t i, bool wide) {
  Position p{v.x[i], v.y[i], v.z[i]};
  for (double& c : p) c = (wide ? c : static_cast<double>(static_cast<float>(c))) + 0.0;
  return p;
}

/// Few places for many vertices, some of them less than a float apart.
VertexBatch crowd(std::mt19937& random, std::size_t count, double offset) {
  std::uniform_int_distribution<> place(-3, 3);
  std::normal_distribution<float> normal;
  VertexBatch v;
  for (std::size_t i = 0; i < count; ++i) {
    v.x.push_back(offset + place(random) * 1e-9);
    v.y.push_back(place(random) * 0.25);
    v.z.push_back(place(random) == 0 ? -0.0 : place(random));
    v.nx.push_back(normal(random));
    v.ny.push_back(normal(random));
    v.nz.push_back(normal(random));
  }
  return v;
}

void expect_apart(unsigned seed, bool wide) {
  std::mt19937 random(seed);
  const double offset = seed % 3 == 0 ? 0 : 1000.0 * (seed % 7);
  DistinctPositions distinct(wide);
  std::set<Position> below;
  for (int slab = 0; slab < 4; ++slab) {
    const VertexBatch given = crowd(random, random() % 300, offset);
    VertexBatch v = given;
    distinct.separate(v);
    std::set<Position> here, placed;
    for (std::size_t i = 0; i < v.size(); ++i) {
      const Position p = written(v, i, wide);
      RC_ASSERT(here.insert(p).second);
      RC_ASSERT(!below.contains(p));
      const bool first = placed.insert(written(given, i, wide)).second && !below.contains(written(given, i, wide));
      if (first) RC_ASSERT(p == written(given, i, wide));
      double moved = 0, largest = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        moved += std::abs(p[k] - written(given, i, wide)[k]);
        largest = std::max(largest, std::abs(p[k]));
      }
      RC_ASSERT(moved <= 1000 * largest * (wide ? 0x1p-52 : 0x1p-23) + 1e-30);
    }
    below = placed;
  }
}

RC_GTEST_PROP(DistinctPositions, NoTwoAreWrittenAlike, (unsigned seed, bool wide)) {
  expect_apart(seed, wide);
}

TEST(DistinctPositions, WhatWasMovedInTheSlabBelowDoesNotMatter) {
  std::mt19937 random(3);
  const VertexBatch first = crowd(random, 200, 5), second = crowd(random, 200, 5), third = crowd(random, 200, 5);
  const auto last_of = [](std::vector<VertexBatch> slabs) {
    DistinctPositions distinct(false);
    for (VertexBatch& slab : slabs) distinct.separate(slab);
    return slabs.back();
  };
  const VertexBatch all = last_of({first, second, third}), fewer = last_of({second, third});
  EXPECT_EQ(all.x, fewer.x);
  EXPECT_EQ(all.y, fewer.y);
  EXPECT_EQ(all.z, fewer.z);
}

TEST(DistinctPositions, KeepsAwayFromOccupiedPlaces) {
  DistinctPositions distinct(false);
  distinct.occupy(1, 2, 3);
  distinct.occupy(1, 2, static_cast<double>(std::nextafter(3.0F, 4.0F)));
  VertexBatch v;
  v.x = {1}, v.y = {2}, v.z = {3};
  v.nx = {0}, v.ny = {0}, v.nz = {1};
  distinct.separate(v);
  EXPECT_EQ(v.x[0], 1);
  EXPECT_EQ(static_cast<float>(v.z[0]), std::nextafter(std::nextafter(3.0F, 4.0F), 4.0F));
}

}  // namespace
}  // namespace lamina
