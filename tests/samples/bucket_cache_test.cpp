#include "samples/bucket_cache.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <random>
#include <tuple>

namespace lamina {
namespace {

/// The samples' numbers in the order asked for, by the definition: std::stable_sort on the block.
std::vector<std::size_t> expected_order(const LocalSamples& s, std::int64_t side) {
  const auto block = [&](std::int32_t c) {
    const std::int64_t q = c / side;
    return q - static_cast<std::int64_t>(c % side < 0);
  };
  std::vector<std::size_t> order(s.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const auto key = [&](std::size_t i) { return std::tuple(block(s.z[i]), block(s.y[i]), block(s.x[i])); };
    return key(a) < key(b);
  });
  return order;
}

/// Every array holds the sample's number, in its own way.
LocalSamples numbered_samples(std::size_t n, std::int32_t low, std::int32_t high, std::mt19937& random) {
  std::uniform_int_distribution<std::int32_t> at(low, high);
  LocalSamples s;
  s.attributes.resize(2);
  for (std::size_t i = 0; i < n; ++i) {
    s.x.push_back(at(random));
    s.y.push_back(at(random));
    s.z.push_back(at(random) / 16);
    const auto number = static_cast<float>(i);
    for (auto* values : {&s.nx, &s.ny, &s.nz, &s.quality})
      values->push_back(number + static_cast<float>(values - &s.nx));
    for (auto& values : s.attributes) values.push_back(number);
  }
  return s;
}

void expect_sorted(const LocalSamples& before, const Lattice& lattice, std::int64_t side) {
  LocalSamples s = before;
  BlockOrderScratch scratch;
  sort_by_block(s, lattice, scratch);
  const auto order = expected_order(before, side);
  RC_ASSERT(s.size() == before.size());
  RC_ASSERT(s.radius.empty());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::size_t from = order[i];
    RC_ASSERT(s.x[i] == before.x[from] && s.y[i] == before.y[from] && s.z[i] == before.z[from]);
    RC_ASSERT(s.nx[i] == before.nx[from] && s.ny[i] == before.ny[from] && s.nz[i] == before.nz[from]);
    RC_ASSERT(s.quality[i] == before.quality[from]);
    RC_ASSERT(s.attributes[0][i] == before.attributes[0][from] && s.attributes[1][i] == before.attributes[1][from]);
  }
}

TEST(BlockOrder, IsByBlocksThenAsItWas) {
  EXPECT_TRUE(rc::check("sorted", [] {
    std::mt19937 random(*rc::gen::arbitrary<unsigned>());
    const std::int32_t cell = 20 + static_cast<std::int32_t>(random() % 200);
    const auto high = static_cast<std::int32_t>(random() % 100'000);
    const LocalSamples s = numbered_samples(random() % 800, -high, high / 2, random);
    expect_sorted(s, {cell, 4}, std::int64_t{8} * cell);
  }));
}

TEST(BlockOrder, TakesLargerBlocksWhereABucketSpansTooMany) {
  std::mt19937 random(4);
  LocalSamples s = numbered_samples(3000, -(1 << 29), 1 << 29, random);
  // Blocks of 64 steps: 2^24 by 2^24 by 2^20 of them; 2^36 too many, 12 doublings.
  s.x[0] = s.y[0] = -(1 << 29);
  s.x[1] = s.y[1] = (1 << 29) - 1;
  s.z[0] = -(1 << 25);
  s.z[1] = (1 << 25) - 1;
  EXPECT_TRUE(rc::check("sorted", [&] { expect_sorted(s, {8, 4}, std::int64_t{64} << 12); }));
}

/// Three buckets, the last one empty.
SlabStore three_buckets(const LocalSamples& samples) {
  StoreSettings settings;
  settings.directory = testing::TempDir();
  settings.z_min = -200;
  settings.bucket_height = 200;
  settings.buckets = 3;
  StoreLayout layout;
  layout.has_quality = true;
  for (const char* name : {"a", "b"}) layout.attributes.push_back({name, ScalarType::float32});
  SlabStoreWriter writer(layout, settings);
  writer.append(samples);
  return writer.finish();
}

TEST(BucketCache, TakesAnOrderThatIsKnown) {
  std::mt19937 random(7);
  const SlabStore store = three_buckets(numbered_samples(3000, -3000, 3000, random));
  const Lattice lattice{20, 4};
  BucketCache cache(store, lattice, 0), other(store, lattice, 0);
  for (std::size_t b = 0; b < 3; ++b) {
    LocalSamples at;
    BlockOrderScratch scratch;
    store.read(b, at, Columns::positions);
    EXPECT_EQ(at.size(), store.count(b));
    EXPECT_TRUE(at.nx.empty() && at.quality.empty());
    cache.know_order(b, order_by_block(at, lattice, scratch));
    const LocalSamples all = cache.get(b)->samples;
    const LocalSamples expected = other.get(b)->samples;
    EXPECT_TRUE(all.x == expected.x && all.y == expected.y && all.z == expected.z);
    EXPECT_TRUE(all.nx == expected.nx && all.ny == expected.ny && all.nz == expected.nz);
    EXPECT_EQ(all.quality, expected.quality);
    EXPECT_EQ(all.attributes, expected.attributes);
    cache.drop(b);
    EXPECT_EQ(cache.get(b)->samples.x, expected.x);  // read once more
  }
}

}  // namespace
}  // namespace lamina
