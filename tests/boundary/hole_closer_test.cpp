#include "boundary/hole_closer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <numbers>

namespace lamina::boundary {
namespace {

/// A circle in a plane that faces up, of edges half an influence radius (1) long. `sense`: 1 where the surface lies
/// inside, -1 where it lies outside.
struct Circle {
  double x = 0, z = 0, radius = 1;
  int sense = 1;
};

void add_circle(const Circle& circle, BoundaryBatch& out) {
  const auto first = static_cast<Number>(out.vertices.size());
  const auto n = static_cast<Number>(std::lround(4 * std::numbers::pi * circle.radius));
  for (Number i = 0; i < n; ++i) {
    const double angle = 2 * std::numbers::pi * circle.sense * static_cast<double>(i) / static_cast<double>(n);
    BoundaryVertex v;
    v.number = first + i;
    v.position = {circle.x + circle.radius * std::cos(angle), circle.radius * std::sin(angle), circle.z};
    v.normal = {0, 0, 1};
    v.radius = 1;
    out.vertices.push_back(v);
    out.edges.push_back({first + i, first + (i + 1) % n, {0, 0, 1}});
  }
}

/// Of a gap twenty influence radii wide, and of what lies beside it.
HoleStats close_gap_beside(const Circle& other) {
  BoundaryBatch batch;
  add_circle({0, 0, 10, -1}, batch);
  add_circle(other, batch);
  HoleSettings settings;
  settings.longest = 300;
  HoleCloser closer(settings, 0, true);
  closer.add(batch);
  closer.finish(batch.vertices.size());
  return closer.stats();
}

TEST(HoleCloser, AScrapOverTheRimKeepsNoGapOpen) {
  const HoleStats stats = close_gap_beside({10, 0.2, 1});
  EXPECT_EQ(stats.closed, 1U);
  ASSERT_EQ(stats.open, 1U);
  EXPECT_EQ(stats.longest.front().reason, "outer boundary");
}

TEST(HoleCloser, AnotherSheetOverTheRimDoes) {
  const HoleStats stats = close_gap_beside({10, 0.2, 5});
  EXPECT_EQ(stats.closed, 0U);
  ASSERT_EQ(stats.open, 2U);
  EXPECT_EQ(stats.longest.front().reason, "occupied");
}

TEST(HoleCloser, WhatLiesFartherOffThanHalfARadiusIsNotInTheGap) {
  EXPECT_EQ(close_gap_beside({10, 0.6, 5}).closed, 1U);
}

}  // namespace
}  // namespace lamina::boundary
