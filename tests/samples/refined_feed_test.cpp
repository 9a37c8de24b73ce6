// Sheets that lie close, as the feed refines them: whatever its buckets, and wherever it begins.
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <utility>

#include "samples/sample_feed.h"
#include "support/streamed_cloud.h"

namespace lamina::test {
namespace {

/// Two sheets that open like a wedge along z, with samples at different places; where they lie close, cells are finer.
LocalSamples wedge() {
  std::mt19937 random(11);
  std::uniform_int_distribution<std::int32_t> across(-600, 600), along(0, 8000);
  LocalSamples cloud;
  for (std::int32_t i = 0; i < 8000; ++i) {
    const float facing = i % 2 == 0 ? 1.0F : -1.0F;
    const std::int32_t z = along(random);
    cloud.x.push_back(static_cast<std::int32_t>(facing) * z / 20);
    cloud.y.push_back(across(random));
    cloud.z.push_back(z);
    cloud.nx.push_back(facing);
    cloud.ny.push_back(0);
    cloud.nz.push_back(0);
    cloud.radius.push_back(z % 3 == 0 ? 92.0F : 185.0F);  // of two levels
  }
  return cloud;
}

using Place = std::array<std::int32_t, 3>;

/// The levels of all samples with z >= from that a feed gives which begins there (nothing: at the bottom).
std::map<Place, std::multiset<int>> levels_from(const LocalSamples& cloud, std::int32_t bucket_height,
                                                std::optional<std::int32_t> from = std::nullopt) {
  const Lattice lattice{40, 4};
  SlabStore store = make_store(cloud, bucket_height);
  FeedSettings settings;
  settings.refine_sheets = true;
  SampleFeed feed(store, lattice, settings, {}, true);
  if (from) feed.begin_at(*from);
  std::map<Place, std::multiset<int>> levels;
  // In small steps, which must change nothing.
  for (std::int64_t limit = -10; limit < 9000; limit += 130) {
    feed.prepare(limit, [&](const Batch& ready) {
      for (const auto& b : ready) {
        for (std::size_t i = 0; i < b->samples.size(); ++i) {
          if (b->samples.z[i] < from.value_or(-1)) continue;
          levels[{b->samples.x[i], b->samples.y[i], b->samples.z[i]}].insert(b->level[i]);
        }
      }
    });
  }
  // Once more from the store: what is found out first is kept.
  for (const auto& batch : feed.batches(-10, 9000, 0)) {
    for (const auto& b : feed.load(batch)) {
      for (std::size_t i = 0; i < b->samples.size(); ++i) {
        if (b->samples.z[i] < from.value_or(-1)) continue;
        const auto& expected = levels.at({b->samples.x[i], b->samples.y[i], b->samples.z[i]});
        EXPECT_TRUE(expected.contains(b->level[i]));
      }
    }
  }
  return levels;
}

TEST(RefinedFeed, SheetsAreRefinedAlikeHoweverBucketsAreCut) {
  const LocalSamples cloud = wedge();
  const auto whole = levels_from(cloud, 10000);  // a single bucket
  std::array<int, 4> with_level{};
  for (const auto& [place, levels] : whole) {
    for (const int level : levels) ++with_level.at(static_cast<std::size_t>(level));
  }
  EXPECT_GT(with_level[0], 100);
  EXPECT_GT(with_level[1], 100);
  EXPECT_GT(with_level[2], 100);
  for (const std::int32_t height : {3, 50, 333, 1000, 4001}) {
    EXPECT_EQ(levels_from(cloud, height), whole) << height;
    for (const std::int32_t from : {1, 777, 5000, 7990}) {
      auto expected = whole;
      std::erase_if(expected, [&](const auto& sample) { return sample.first[2] < from; });
      EXPECT_EQ(levels_from(cloud, height, from), expected) << height << " from " << from;
    }
  }
}

/// A store of the buckets that are said to be read is enough, from below and from above.
TEST(RefinedFeed, SheetsNeedNoMoreBucketsThanAreRead) {
  const LocalSamples cloud = wedge();
  const Lattice lattice{40, 4};
  FeedSettings settings;
  settings.refine_sheets = true;
  const auto whole = levels_from(cloud, 10000);
  for (const std::int32_t height : {50, 333, 1000}) {
    const SlabStore all = make_store(cloud, height);
    for (const std::int32_t from : {400, 3000}) {
      const std::int32_t to = from + 2000;
      const BucketSpan span = buckets_read(all, feed_halo(settings, lattice, {}, true), from, to);
      LocalSamples held, bucket;
      for (std::size_t b = span.begin; b < span.end; ++b) {
        all.read(b, bucket);
        for (const auto& [into, of] : {std::pair{&held.x, &bucket.x}, {&held.y, &bucket.y}, {&held.z, &bucket.z}})
          into->insert(into->end(), of->begin(), of->end());
        for (const auto& [into, of] : {std::pair{&held.nx, &bucket.nx},
                                       {&held.ny, &bucket.ny},
                                       {&held.nz, &bucket.nz},
                                       {&held.radius, &bucket.radius}})
          into->insert(into->end(), of->begin(), of->end());
      }
      EXPECT_LT(held.size(), cloud.size());
      std::map<Place, std::multiset<int>> expected = whole;
      const auto outside = [&](const auto& sample) { return sample.first[2] < from || sample.first[2] >= to; };
      std::erase_if(expected, outside);
      auto found = levels_from(held, height, from);
      std::erase_if(found, outside);
      EXPECT_EQ(found, expected) << height << " from " << from;
    }
  }
}

}  // namespace
}  // namespace lamina::test
