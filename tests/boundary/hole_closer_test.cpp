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

/// The slit, 10 influence radii long, between a plane's edge and a plane `step` lower that begins below it, both facing
/// up; or, the other way around, the outer boundary of the wall that would stand in it.
BoundaryBatch slit_of(double step, bool outer_boundary) {
  constexpr Number kSide = 20;
  BoundaryBatch batch;
  for (Number i = 0; i < 2 * kSide; ++i) {
    const bool upper = i < kSide;
    const auto along = static_cast<double>(upper ? kSide - i : i - kSide + 1);
    BoundaryVertex v;
    v.number = i;
    v.position = {along / 2, 0, upper ? 0 : -step};
    if (outer_boundary) {
      v.normal = {0, -1, 0};
    } else {
      v.normal = {0, 0, 1};
    }
    v.radius = 1;
    batch.vertices.push_back(v);
    const Number next = (i + 1) % (2 * kSide);
    batch.edges.push_back({i, next, {0, double{v.normal[1]}, double{v.normal[2]}}});
  }
  return batch;
}

std::uint64_t closed_slits(const BoundaryBatch& batch, bool bridge) {
  HoleSettings settings;
  settings.longest = 300;
  settings.bridge = bridge;
  HoleCloser closer(settings, 0, true);
  closer.add(batch);
  closer.finish(batch.vertices.size());
  return closer.stats().closed;
}

TEST(HoleCloser, NarrowSlitsAreBridgedWhateverTheirSidesDo) {
  EXPECT_EQ(closed_slits(slit_of(0.4, false), true), 1U);
  EXPECT_EQ(closed_slits(slit_of(0.4, false), false), 0U) << "nobody asked for bridges";
  EXPECT_EQ(closed_slits(slit_of(1.5, false), true), 0U) << "too wide";
}

TEST(HoleCloser, NarrowSheetsAreNoSlits) {
  EXPECT_EQ(closed_slits(slit_of(0.4, true), true), 0U);
}

}  // namespace
}  // namespace lamina::boundary
