#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>

#include "lamina/error.h"
#include "samples/radius_estimator.h"

namespace lamina {
namespace {

using Point = std::array<std::int32_t, 3>;
using Cloud = std::vector<Point>;
using GridCell = std::array<std::int64_t, 3>;

GridCell cell_of(const Point& p, std::int64_t side) {
  GridCell c{};
  for (std::size_t a = 0; a < 3; ++a)
    c[a] = static_cast<std::int64_t>(std::floor(static_cast<double>(p[a]) / static_cast<double>(side)));
  return c;
}

/// The definition, straight: counts in maps, one sample at a time.
class Oracle {
 public:
  Oracle(const RadiiSettings& s, const Cloud& cloud) : s_(s), counts_(static_cast<std::size_t>(s.levels)) {
    for (int l = 0; l < s.levels; ++l) {
      for (const auto& p : cloud) ++counts_[static_cast<std::size_t>(l)][cell_of(p, side(l))];
    }
  }
  [[nodiscard]] double radius(const Point& p) const {
    int level = 0;
    while (level + 1 < s_.levels && count(level, cell_of(p, side(level))) < s_.min_samples) ++level;
    double r = own(level, cell_of(p, side(level)));
    for (int l = 0; l <= level; ++l) r = std::min(r, bound(l, cell_of(p, side(l))));
    return r;
  }
  [[nodiscard]] double unbounded(const Point& p) const {
    int level = 0;
    while (level + 1 < s_.levels && count(level, cell_of(p, side(level))) < s_.min_samples) ++level;
    return own(level, cell_of(p, side(level)));
  }

 private:
  [[nodiscard]] std::int64_t side(int level) const { return static_cast<std::int64_t>(s_.finest_cell) << level; }
  [[nodiscard]] std::uint64_t count(int level, const GridCell& c) const {
    const auto& counts = counts_[static_cast<std::size_t>(level)];
    const auto found = counts.find(c);
    return found == counts.end() ? 0 : found->second;
  }
  [[nodiscard]] double own(int level, const GridCell& c) const {
    return 2 * std::sqrt(static_cast<double>(side(level)) * static_cast<double>(side(level)) /
                         static_cast<double>(count(level, c)));
  }
  [[nodiscard]] bool refined(int level, const GridCell& c) const {
    for (int i = 0; level > 0 && i < 8; ++i) {
      if (count(level - 1, {2 * c[0] + (i & 1), 2 * c[1] + (i >> 1 & 1), 2 * c[2] + (i >> 2)}) >= s_.min_samples)
        return true;
    }
    return false;
  }
  [[nodiscard]] double bound(int level, const GridCell& c) const {
    double least = std::numeric_limits<double>::infinity();
    const std::uint64_t enough = level + 1 == s_.levels ? 1 : s_.min_samples;
    for (int i = 0; i < 27; ++i) {
      const GridCell n{c[0] + i % 3 - 1, c[1] + i / 3 % 3 - 1, c[2] + i / 9 - 1};
      if (count(level, n) >= enough && !refined(level, n)) least = std::min(least, own(level, n));
    }
    return s_.neighbour_bound * least;
  }

  RadiiSettings s_;
  std::vector<std::map<GridCell, std::uint64_t>> counts_;
};

/// Radii of a cloud sorted by z, pushed in buckets that end before the given z values.
std::vector<float> estimate(const RadiiSettings& settings, const Cloud& cloud, const std::vector<std::int32_t>& cuts) {
  RadiusEstimator estimator(settings);
  std::vector<float> all, radii;
  const auto take = [&] {
    while (estimator.pop(radii)) all.insert(all.end(), radii.begin(), radii.end());
  };
  std::size_t i = 0;
  for (std::size_t b = 0; b <= cuts.size(); ++b) {
    LocalSamples bucket;
    for (; i < cloud.size() && (b == cuts.size() || cloud[i][2] < cuts[b]); ++i) {
      bucket.x.push_back(cloud[i][0]);
      bucket.y.push_back(cloud[i][1]);
      bucket.z.push_back(cloud[i][2]);
    }
    estimator.push(bucket);
    if (b % 3 != 1) take();
  }
  estimator.finish();
  take();
  return all;
}

void sort_by_z(Cloud& cloud) {
  std::stable_sort(cloud.begin(), cloud.end(), [](auto& a, auto& b) { return a[2] < b[2]; });
}

enum class Shape { plane, sphere, clipped, step, blob };

/// About the origin, so that coordinates of both signs occur; size is the half extent in steps.
Cloud make_cloud(Shape shape, std::size_t n, double size, std::mt19937& random) {
  std::uniform_real_distribution<double> u(-1, 1);
  std::normal_distribution<double> normal;
  Cloud cloud;
  for (std::size_t i = 0; i < n; ++i) {
    std::array<double, 3> p{u(random), u(random), 0.37 * u(random)};
    if (shape == Shape::plane) p[2] = 0.3 * p[0] + 0.7 * p[1];
    if (shape == Shape::clipped) p[2] = 0.0123;  // cell layers of some levels are cut close to this
    if (shape == Shape::step) {
      if (i % 65 == 0)
        p[0] = -std::abs(p[0]);  // one in 65 on this half: a step of 64 in density
      else
        p[0] = std::abs(p[0]);
      p[2] = 0.9 * p[0] + 0.2 * p[1];
    }
    if (shape == Shape::sphere) {
      for (auto& c : p) c = normal(random);
      const double length = std::hypot(p[0], p[1], p[2]);
      for (auto& c : p) c /= length;
    }
    Point q{};
    for (std::size_t a = 0; a < 3; ++a) q[a] = static_cast<std::int32_t>(std::lround(p[a] * size));
    cloud.push_back(q);
  }
  sort_by_z(cloud);
  return cloud;
}

void expect_oracle(const RadiiSettings& settings, const Cloud& cloud, const std::vector<std::int32_t>& cuts) {
  const auto radii = estimate(settings, cloud, cuts);
  ASSERT_EQ(radii.size(), cloud.size());
  const Oracle oracle(settings, cloud);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const double truth = oracle.radius(cloud[i]);
    ASSERT_NEAR(radii[i], truth, 1e-5 * truth) << i;
  }
}

TEST(RadiusEstimator, AgreesWithTheDefinition) {
  std::mt19937 random(1);
  for (const auto shape : {Shape::plane, Shape::sphere, Shape::clipped, Shape::step, Shape::blob}) {
    const auto cloud = make_cloud(shape, 6000, 100'000, random);
    expect_oracle({3500, 5, 16, 1.5F}, cloud, {-60'000, -20'000, 0, 1, 30'000, 99'999});
    expect_oracle({1001, 3, 16, 1.5F}, cloud, {});
  }
}

TEST(RadiusEstimator, AgreesWithTheDefinitionForAnySettings) {
  const bool good = rc::check("oracle", [] {
    std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
    const auto shape = static_cast<Shape>(*rc::gen::inRange(0, 5));
    const auto size = *rc::gen::element(5.0, 1000.0, 2e9);
    const auto cloud = make_cloud(shape, *rc::gen::inRange<std::size_t>(0, 600), size, random);
    const auto finest = static_cast<std::int32_t>(std::max(1.0, size / *rc::gen::inRange(1, 100)));
    const RadiiSettings settings{finest, *rc::gen::inRange(1, 8), *rc::gen::inRange(1U, 30U),
                                 static_cast<float>(*rc::gen::inRange(10, 40)) / 10};
    std::vector<std::int32_t> cuts;
    const int count = *rc::gen::inRange(0, 10);
    for (int i = 0; i < count; ++i)
      cuts.push_back(static_cast<std::int32_t>(size * *rc::gen::inRange(-100, 100) / 100));
    std::sort(cuts.begin(), cuts.end());
    const auto radii = estimate(settings, cloud, cuts);
    RC_ASSERT(radii.size() == cloud.size());
    const Oracle oracle(settings, cloud);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const double truth = oracle.radius(cloud[i]);
      RC_ASSERT(std::abs(radii[i] - truth) <= 1e-5 * truth);
    }
  });
  EXPECT_TRUE(good);
}

TEST(RadiusEstimator, DoesNotDependOnBucketsOrThreads) {
  std::mt19937 random(2);
  const auto cloud = make_cloud(Shape::step, 60'000, 1e6, random);
  const RadiiSettings settings{9000, 5, 16, 1.5F};
  const auto whole = estimate(settings, cloud, {});
  std::vector<std::int32_t> cuts(700);
  for (auto& c : cuts) c = static_cast<std::int32_t>(random() % 2'400'000) - 1'200'000;
  std::sort(cuts.begin(), cuts.end());
  EXPECT_EQ(estimate(settings, cloud, cuts), whole);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(estimate(settings, cloud, {-3, 500'000}), whole);
}

TEST(RadiusEstimator, TamesClippedCellsAndKeepsStepsInDensity) {
  std::mt19937 random(3);
  const std::size_t n = 100'000;
  const double size = 1e7;
  const auto cloud = make_cloud(Shape::step, n, size, random);
  const double stretch = std::sqrt(1 + 0.9 * 0.9 + 0.2 * 0.2);  // area of the tilted plane
  const double dense = 2 * std::sqrt(2 * size * size * stretch / (static_cast<double>(n) * 64 / 65));
  const RadiiSettings settings{static_cast<std::int32_t>(2 * dense), 5, 16, 1.5F};
  const auto radii = estimate(settings, cloud, {});
  const Oracle oracle(settings, cloud);
  double longest = 0, unbounded = 0;
  std::size_t sparse = 0, shortened = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double truth = cloud[i][0] < 0 ? 8 * dense : dense;
    longest = std::max(longest, radii[i] / truth);
    unbounded = std::max(unbounded, oracle.unbounded(cloud[i]) / truth);
    if (cloud[i][0] < 0) {
      ++sparse;
      shortened += radii[i] < 0.5 * truth ? 1U : 0U;
    }
  }
  EXPECT_GT(unbounded, 4);
  EXPECT_LT(longest, 2.5);
  EXPECT_LT(shortened, sparse / 10);  // those within a cell of the step
}

TEST(RadiusEstimator, CoincidentSamplesHaveTinyRadii) {
  const Cloud cloud(200'000, Point{-7, 12, -1});
  for (const float r : estimate({1000, 5, 16, 1.5F}, cloud, {})) ASSERT_NEAR(r, 2000 / std::sqrt(200'000.0), 1e-3);
}

TEST(RadiusEstimator, TakesTheWholeRangeOfCoordinates) {
  constexpr auto low = std::numeric_limits<std::int32_t>::min();
  constexpr auto high = std::numeric_limits<std::int32_t>::max();
  Cloud cloud;
  for (const auto x : {low, -1, 0, high}) {
    for (const auto z : {low, -1, 0, high}) cloud.push_back({x, -x - 1, z});
  }
  sort_by_z(cloud);
  for (const int levels : {1, 5, 31}) expect_oracle({1, levels, 2, 1.5F}, cloud, {0});
  expect_oracle({high, 2, 2, 1.5F}, cloud, {-5, 5});
}

TEST(RadiusEstimator, HoldsBackWhatIsNotComplete) {
  RadiusEstimator estimator({10, 2, 16, 1.5F});  // groups of 20
  std::vector<float> radii;
  EXPECT_FALSE(estimator.pop(radii));
  LocalSamples bucket;
  bucket.x = bucket.y = {0, 0};
  bucket.z = {0, 19};
  estimator.push(bucket);
  EXPECT_FALSE(estimator.pop(radii));
  bucket.z = {20, 39};
  estimator.push(bucket);
  EXPECT_FALSE(estimator.pop(radii));
  bucket.z = {40, 41};
  estimator.push(bucket);
  EXPECT_TRUE(estimator.pop(radii));
  EXPECT_EQ(radii.size(), 2U);
  EXPECT_FALSE(estimator.pop(radii));
  estimator.finish();
  EXPECT_TRUE(estimator.pop(radii));
  EXPECT_TRUE(estimator.pop(radii));
  EXPECT_FALSE(estimator.pop(radii));
}

TEST(RadiusEstimator, RefusesWhatItCannotDo) {
  EXPECT_THROW(RadiusEstimator({0, 5, 16, 1.5F}), Error);
  EXPECT_THROW(RadiusEstimator({1, 0, 16, 1.5F}), Error);
  EXPECT_THROW(RadiusEstimator({1, 32, 16, 1.5F}), Error);
  EXPECT_THROW(RadiusEstimator({1, 5, 0, 1.5F}), Error);
  EXPECT_THROW(RadiusEstimator({1, 5, 16, 0.9F}), Error);
  RadiusEstimator estimator({10, 1, 16, 1.5F});
  LocalSamples bucket;
  bucket.x = bucket.y = bucket.z = {50};
  estimator.push(bucket);
  bucket.z = {49};
  EXPECT_THROW(estimator.push(bucket), Error);
}

}  // namespace
}  // namespace lamina
