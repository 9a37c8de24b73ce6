#include "samples/neighbourhoods.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "support/streamed_cloud.h"

namespace lamina::test {
namespace {

/// A sheet with as many samples again in one corner of it, and single ones above.
LocalSamples uneven_cloud() {
  LocalSamples s;
  std::mt19937 random(5);
  std::uniform_int_distribution<std::int32_t> wide(-200'000, 200'000);
  std::uniform_int_distribution<std::int32_t> narrow(0, 8'000);
  std::uniform_int_distribution<std::int32_t> thin(-500, 500);
  const auto add = [&](std::int32_t x, std::int32_t y, std::int32_t z) {
    s.x.push_back(x);
    s.y.push_back(y);
    s.z.push_back(z);
    s.nx.push_back(0);
    s.ny.push_back(1);
    s.nz.push_back(0);
  };
  for (int i = 0; i < 1000; ++i) add(wide(random), thin(random), wide(random));
  for (int i = 0; i < 1000; ++i) add(narrow(random), thin(random), narrow(random));
  for (int i = 0; i < 150; ++i) add(wide(random), wide(random), wide(random));
  return s;
}

void all_doubtful(const Placed& /*samples*/, const SampleLeaf& leaf, std::uint8_t* doubtful) {
  std::fill_n(doubtful, leaf.size(), std::uint8_t{1});
}

template <typename Samples>
float squared_between(const Samples& s, std::size_t a, const Placed& p, std::size_t place) {
  const auto dx = static_cast<float>(s.x[a] - p.x[place]);
  const auto dy = static_cast<float>(s.y[a] - p.y[place]);
  const auto dz = static_cast<float>(s.z[a] - p.z[place]);
  return dx * dx + dy * dy + dz * dz;
}

/// Squared distances from a place to all samples but itself, ascending.
std::vector<float> distances(const LocalSamples& s, const Placed& placed, std::size_t place) {
  std::vector<float> out;
  for (std::size_t i = 0; i < s.size(); ++i) out.push_back(squared_between(s, i, placed, place));
  std::sort(out.begin(), out.end());
  out.erase(out.begin());
  return out;
}

class Neighbours : public testing::TestWithParam<std::int32_t> {};

/// Whatever the buckets' height: every sample is a slab's own once, and its neighbours are those of any search.
TEST_P(Neighbours, AreTheNearestOfAll) {
  constexpr float kReach = 9'000;
  const LocalSamples s = uneven_cloud();
  const SlabStore store = make_store(s, GetParam());
  KeepMasks masks(store.buckets());
  for (std::size_t b = 0; b < masks.size(); ++b) masks[b].assign(store.count(b), true);
  Neighbourhoods around(store, masks, kReach, all_doubtful);
  std::size_t own = 0;
  std::size_t few = 0;
  while (around.advance()) {
    for (const SampleLeaf& leaf : around.leaves()) {
      std::vector<std::uint32_t> places;
      for (std::size_t p = leaf.begin; p < leaf.end; ++p) {
        if (around.is_own(p)) places.push_back(static_cast<std::uint32_t>(p));
        EXPECT_TRUE(around.is_doubtful(p));
      }
      own += places.size();
      std::vector<Neighbourhoods::Nearest> found(places.size());
      if (!places.empty()) around.find_nearest(places, found.data());
      for (std::size_t i = 0; i < places.size(); ++i) {
        const std::vector<float> truth = distances(s, around.samples(), places[i]);
        const auto within = [&](float reach) {
          return static_cast<std::size_t>(std::upper_bound(truth.begin(), truth.end(), reach * reach) - truth.begin());
        };
        ASSERT_EQ(found[i].count, std::min(Neighbourhoods::kNeighbours, within(kReach)));
        for (std::size_t k = 0; k < found[i].count; ++k)
          ASSERT_EQ(squared_between(around.samples(), found[i].places[k], around.samples(), places[i]), truth[k]);
        if (found[i].count == Neighbourhoods::kNeighbours) continue;
        ++few;
        ASSERT_EQ(around.count_within_twice(places[i]), within(2 * kReach));
      }
    }
  }
  EXPECT_EQ(own, s.size());
  EXPECT_GT(few, 75u) << "single samples";
}

INSTANTIATE_TEST_SUITE_P(Buckets, Neighbours, testing::Values(1 << 11, 1 << 14, 1 << 20));

/// A slab ends where enough samples are its own: none of a long cloud is left out or comes twice.
TEST(Neighbourhoods, SlabsFollowOneAnother) {
  LocalSamples s;
  std::mt19937 random(6);
  std::uniform_int_distribution<std::int32_t> across(0, 3'000);
  for (int i = 0; i < 400'000; ++i) {
    s.x.push_back(across(random));
    s.y.push_back(across(random));
    s.z.push_back(i);
    s.nx.push_back(0);
    s.ny.push_back(1);
    s.nz.push_back(0);
  }
  const SlabStore store = make_store(s, 1 << 13);
  KeepMasks masks(store.buckets());
  for (std::size_t b = 0; b < masks.size(); ++b) masks[b].assign(store.count(b), true);
  Neighbourhoods around(store, masks, 1'000, all_doubtful);
  std::vector<int> times(s.size(), 0);
  int slabs = 0;
  while (around.advance()) {
    ++slabs;
    for (std::size_t p = 0; p < around.samples().size(); ++p) {
      if (around.is_own(p)) ++times[static_cast<std::size_t>(around.samples().z[p])];
    }
  }
  EXPECT_GT(slabs, 1);
  EXPECT_EQ(std::count(times.begin(), times.end(), 1), static_cast<std::ptrdiff_t>(s.size()));
}

}  // namespace
}  // namespace lamina::test
