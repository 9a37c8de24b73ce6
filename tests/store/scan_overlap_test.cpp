#include "store/ingest.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace lamina {
namespace {

/// Grids of samples over [first, first + 2] x [0, 2], in pieces, one scan after another.
double overlap_of(const std::vector<double>& firsts) {
  constexpr int kSide = 300;
  std::vector<ScanPart> scans;
  for (std::size_t s = 0; s < firsts.size(); ++s) scans.push_back({.first = s * kSide * kSide});
  ScanOverlap overlap(scans, {0, 0, 0}, {3, 2, 0});
  SampleBatch batch;
  for (const double first : firsts) {
    for (int row = 0; row < kSide; ++row) {
      batch.first += batch.size();
      batch.x.assign(kSide, first + 2.0 * row / kSide);
      batch.y.resize(kSide);
      for (int i = 0; i < kSide; ++i) batch.y[static_cast<std::size_t>(i)] = 2.0 * i / kSide;
      batch.z.assign(kSide, row == 7 ? std::numeric_limits<double>::quiet_NaN() : 0);
      overlap.add(batch);
    }
  }
  return overlap.share();
}

TEST(ScanOverlap, IsTheShareOfPlacesSeenTwice) {
  EXPECT_EQ(overlap_of({}), 0);
  EXPECT_EQ(overlap_of({0}), 0);
  EXPECT_NEAR(overlap_of({0, 1}), 1.0 / 3, 0.03);
  EXPECT_NEAR(overlap_of({0, 1, 0}), 2.0 / 3, 0.05);
  EXPECT_EQ(overlap_of({0, 0}), 1);
}

}  // namespace
}  // namespace lamina
