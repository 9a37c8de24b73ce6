#include "samples/cleaning.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <cmath>

namespace lamina {
namespace {

LocalSamples some_samples(std::size_t count, int extent, bool two_sided) {
  LocalSamples s;
  for (std::size_t i = 0; i < count; ++i) {
    s.x.push_back(*rc::gen::inRange(-extent, extent));
    s.y.push_back(*rc::gen::inRange(-extent, extent));
    s.z.push_back(*rc::gen::inRange(-extent, extent));
    s.nx.push_back(0);
    s.ny.push_back(0);
    s.nz.push_back(two_sided && *rc::gen::arbitrary<bool>() ? -1.0F : 1.0F);
  }
  return s;
}

LocalSamples part_of(const LocalSamples& s, const std::vector<std::size_t>& which) {
  LocalSamples out;
  for (const std::size_t i : which) {
    out.x.push_back(s.x[i]), out.y.push_back(s.y[i]), out.z.push_back(s.z[i]);
    out.nx.push_back(s.nx[i]), out.ny.push_back(s.ny[i]), out.nz.push_back(s.nz[i]);
  }
  return out;
}

/// Every sample against every kept one.
std::vector<bool> brute_force(const LocalSamples& s, double distance) {
  std::vector<bool> keep(s.size(), true);
  for (std::size_t i = 0; i < s.size(); ++i) {
    for (std::size_t j = 0; j < i && keep[i]; ++j) {
      const double d = std::hypot(double(s.x[i]) - s.x[j], double(s.y[i]) - s.y[j], double(s.z[i]) - s.z[j]);
      if (keep[j] && d <= distance && s.nz[i] * s.nz[j] > 0) keep[i] = false;
    }
  }
  return keep;
}

RC_GTEST_PROP(Thinner, LeavesOutWhatBruteForceLeavesOutHoweverTheCloudIsCut, ()) {
  const int extent = *rc::gen::element(3, 20, 200, 100000);
  const LocalSamples all = some_samples(*rc::gen::inRange<std::size_t>(0, 150), extent, *rc::gen::arbitrary<bool>());
  const double distance = *rc::gen::element(0.0, 1.0, 2.5, 10.0, 0.2 * extent, 3.0 * extent);
  // Buckets by ascending z, inside in the order of the input.
  const int height = *rc::gen::inRange(1, 2 * extent + 1);
  Thinner thinner(distance);
  std::vector<std::size_t> order;
  std::vector<bool> keep;
  std::uint64_t dropped = 0;
  for (int low = -extent; low < extent; low += height) {
    std::vector<std::size_t> bucket;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all.z[i] >= low && all.z[i] < low + height) bucket.push_back(i);
    }
    std::vector<bool> mask(bucket.size(), true);
    dropped += thinner.thin(part_of(all, bucket), mask);
    order.insert(order.end(), bucket.begin(), bucket.end());
    keep.insert(keep.end(), mask.begin(), mask.end());
  }
  RC_ASSERT(keep == brute_force(part_of(all, order), distance));
  RC_ASSERT(dropped == static_cast<std::uint64_t>(std::count(keep.begin(), keep.end(), false)));
}

TEST(Thinner, SamplesThatAreNotThereNeitherStayNorDriveOthersOut) {
  LocalSamples s;
  s.x = {0, 0, 0}, s.y = {0, 0, 0}, s.z = {0, 0, 0};
  s.nx = {0, 0, 0}, s.ny = {0, 0, 0}, s.nz = {1, 1, 1};
  std::vector<bool> keep{false, true, true};
  EXPECT_EQ(Thinner(0).thin(s, keep), 1U);
  EXPECT_EQ(keep, (std::vector<bool>{false, true, false}));
}

}  // namespace
}  // namespace lamina
