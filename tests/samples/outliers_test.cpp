#include "samples/cleaning.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cmath>
#include <random>

namespace lamina {
namespace {

Positions random_positions(std::size_t count, int extent, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<std::int32_t> at(-extent, extent);
  Positions p;
  for (std::size_t i = 0; i < count; ++i) {
    p.x.push_back(at(random));
    p.y.push_back(at(random));
    p.z.push_back(at(random) / 4);
  }
  return p;
}

float mean_by_all_pairs(const Positions& p, std::size_t i, std::uint32_t neighbours, double farthest) {
  std::vector<double> d;
  for (std::size_t j = 0; j < p.size(); ++j) {
    if (j != i) d.push_back(std::hypot(double(p.x[i]) - p.x[j], double(p.y[i]) - p.y[j], double(p.z[i]) - p.z[j]));
  }
  d.resize(std::max<std::size_t>(d.size(), neighbours), 1e30);
  std::sort(d.begin(), d.end());
  double sum = 0;
  for (std::uint32_t k = 0; k < neighbours; ++k) sum += std::min(d[k], farthest);
  return static_cast<float>(sum / neighbours);
}

RC_GTEST_PROP(MeanDistances, AreThoseOfAllPairs, ()) {
  const Positions p = random_positions(*rc::gen::inRange<std::size_t>(1, 120),
                                       *rc::gen::element(1 << 12, 1 << 16, 1 << 29), *rc::gen::arbitrary<unsigned>());
  const auto neighbours = *rc::gen::inRange<std::uint32_t>(1, 20);
  const std::int32_t cell = *rc::gen::element(1024, 4096, 100000, 1 << 27);
  const std::size_t wanted = *rc::gen::inRange<std::size_t>(0, p.size() + 1);
  const std::vector<float> means = mean_distances(p, wanted, neighbours, cell);
  RC_ASSERT(means.size() == wanted);
  for (std::size_t i = 0; i < wanted; ++i) {
    const float truth = mean_by_all_pairs(p, i, neighbours, double{kFarthestCells} * cell);
    RC_ASSERT(std::abs(means[i] - truth) <= 1e-6F * truth);
  }
}

TEST(CountingCell, HoldsAsManyAsAskedForOnAverage) {
  // A square of 100 x 100 samples, 2000 steps apart: 16 in cells of 8000, so 8192 is the least with 12.
  Positions p;
  for (int i = 0; i < 100; ++i) {
    for (int j = 0; j < 100; ++j) p.x.push_back(2000 * i), p.y.push_back(2000 * j), p.z.push_back(0);
  }
  EXPECT_EQ(counting_cell(p, 12), 8192);
  EXPECT_EQ(counting_cell(p, 0.5), 1024);
  EXPECT_EQ(counting_cell(p, 1e9), 1 << 28) << "the coarsest";
}

}  // namespace
}  // namespace lamina
