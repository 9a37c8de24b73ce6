#include "samples/sample_tree.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "samples/nearest_search.h"

namespace lamina::normals {
namespace {

struct Positions {
  std::vector<std::int32_t> x, y, z;
};

Positions random_positions(std::size_t n, std::int32_t range, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<std::int32_t> at(-range, range);
  Positions p;
  for (std::size_t i = 0; i < n; ++i) {
    p.x.push_back(at(random));
    p.y.push_back(at(random));
    p.z.push_back(at(random));
  }
  return p;
}

/// All other samples by distance, computed without the tree.
std::vector<Neighbour> all_by_distance(const SampleTree& tree, std::uint32_t place) {
  std::vector<Neighbour> all;
  for (std::uint32_t i = 0; i < tree.size(); ++i) {
    if (i == place) continue;
    float squared = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const float d = tree.offset(place, i)[a];
      squared += d * d;
    }
    all.push_back({squared, i});
  }
  std::sort(all.begin(), all.end());
  return all;
}

/// As many at once as `search` takes, found by one kernel.
void expect_nearest(const Positions& p, std::size_t k, float bound, const NearKernel& kernel) {
  const SampleTree tree(p.x, p.y, p.z);
  std::array<Neighbour, SampleTree::kMostNeighbours> found;
  NearestSearch search(tree, kernel);
  std::array<Neighbour, SampleTree::kMostNeighbours> found_in_turn;
  const auto step = static_cast<std::uint32_t>(tree.size() / 40 + 1);
  for (std::uint32_t place = 0; place < tree.size(); ++place) {
    if (place % NearestSearch::kAtOnce == 0) {
      std::vector<std::uint32_t> places(std::min(NearestSearch::kAtOnce, tree.size() - place));
      std::iota(places.begin(), places.end(), place);
      search.start(places, k, bound);
    }
    const std::size_t in_turn = search.finish(place % NearestSearch::kAtOnce, found_in_turn.data());
    if (place % step != 0) continue;
    std::vector<Neighbour> expected = all_by_distance(tree, place);
    std::erase_if(expected, [&](const Neighbour& n) { return n.squared > bound; });
    expected.resize(std::min(expected.size(), k));
    const std::size_t count = tree.nearest(place, k, bound, found.data());
    ASSERT_EQ(count, expected.size()) << place;
    ASSERT_EQ(in_turn, count) << place;
    for (std::size_t i = 0; i < count; ++i) {
      ASSERT_EQ(found[i].squared, expected[i].squared) << place << ", " << i;
      ASSERT_EQ(found[i].sample, expected[i].sample) << place << ", " << i;
      ASSERT_EQ(found_in_turn[i].squared, expected[i].squared) << place << ", " << i;
      ASSERT_EQ(found_in_turn[i].sample, expected[i].sample) << place << ", " << i;
    }
  }
}

void expect_nearest(const Positions& p, std::size_t k, float bound) {
  for (const NearKernel* kernel : available_near_kernels()) expect_nearest(p, k, bound, *kernel);
}

TEST(SampleTree, FindsTheNearestOfScatteredSamples) {
  const Positions p = random_positions(3000, 1 << 29, 1);
  for (const std::size_t k : {1, 8, 16, 64}) expect_nearest(p, k, 1e30F);
}

TEST(SampleTree, KeepsToTheBound) {
  const float side = 1 << 27;
  expect_nearest(random_positions(2000, 1 << 29, 2), 30, side * side);
}

// Few distinct places: most distances are equal, and the order of places decides.
TEST(SampleTree, OrdersEquallyNearSamplesByPlace) {
  expect_nearest(random_positions(2000, 4, 3), 20, 1e30F);
  expect_nearest(random_positions(500, 0, 4), 20, 1e30F);
}

TEST(SampleTree, TakesFewerSamplesThanWanted) {
  for (std::size_t n = 0; n < 30; ++n) expect_nearest(random_positions(n, 100, 5), 40, 1e30F);
}

RC_GTEST_PROP(SampleTree, NearestAreThoseOfAnySearch, ()) {
  const auto n = *rc::gen::inRange<std::size_t>(0, 200);
  const auto range = *rc::gen::element(1, 10, 1000, 1 << 29);
  const auto k = *rc::gen::inRange<std::size_t>(1, 40);
  const auto bound = *rc::gen::element(1.0F, 50.0F, 1e30F);
  expect_nearest(random_positions(n, range, *rc::gen::arbitrary<unsigned>()), k, bound);
}

// On a surface some lie dense and some far out, so that searches go on from guesses that fit and from those that do
// not.
TEST(SampleTree, FindsTheNearestOfUnevenSamplesOneAfterAnother) {
  std::mt19937 random(8);
  std::normal_distribution<> normal;
  Positions p;
  for (int i = 0; i < 6000; ++i) {
    const double spread = i % 10 == 0 ? 1e7 : 3e5;
    p.x.push_back(static_cast<std::int32_t>(spread * normal(random)));
    p.y.push_back(static_cast<std::int32_t>(spread * normal(random)));
    p.z.push_back(static_cast<std::int32_t>(0.01 * spread * normal(random)));
  }
  for (const std::size_t k : {1, 12, 16, 17}) expect_nearest(p, k, 1e30F);
  expect_nearest(p, 16, 1e10F);
}

TEST(SampleTree, VisitsAllOfAShell) {
  const Positions p = random_positions(2000, 100, 9);
  const SampleTree tree(p.x, p.y, p.z);
  constexpr float kInner = 20 * 20;
  constexpr float kOuter = 40 * 40;
  for (std::uint32_t place = 0; place < tree.size(); place += 50) {
    std::vector<std::uint32_t> expected;
    for (const Neighbour& n : all_by_distance(tree, place)) {
      if (n.squared > kInner && n.squared <= kOuter) expected.push_back(n.sample);
    }
    std::sort(expected.begin(), expected.end());
    std::vector<std::uint32_t> found;
    tree.fours_within({place, kInner, kOuter}, [&](const SampleTree::FourSamples& four) {
      for (std::size_t i = 0; i < 4; ++i) {
        if (four.squared[i] > kInner && four.squared[i] <= kOuter)
          found.push_back(static_cast<std::uint32_t>(four.places[i]));
      }
    });
    ASSERT_EQ(found, expected) << place;
  }
}

TEST(SampleTree, GivesEverySampleAPlace) {
  const Positions p = random_positions(1000, 50, 7);
  const SampleTree tree(p.x, p.y, p.z);
  std::vector<std::uint32_t> order = tree.order();
  for (std::uint32_t i = 0; i < order.size(); ++i) ASSERT_EQ(tree.position(i)[1], p.y[order[i]]);
  std::sort(order.begin(), order.end());
  for (std::uint32_t i = 0; i < order.size(); ++i) ASSERT_EQ(order[i], i);
}

}  // namespace
}  // namespace lamina::normals
