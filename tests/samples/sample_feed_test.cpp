#include "samples/sample_feed.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <set>

#include "store/block_codec.h"
#include "support/random_cloud.h"
#include "support/streamed_cloud.h"

namespace lamina::test {
namespace {

constexpr std::int64_t kEverything = std::numeric_limits<std::int32_t>::max();

/// A store and the samples of each of its buckets in the feed's order.
struct Stored {
  SlabStore store;
  std::vector<LocalSamples> buckets;

  Stored(const LocalSamples& cloud, const Lattice& lattice, std::int32_t bucket_height)
      : store(make_store(cloud, bucket_height)) {
    buckets.resize(store.buckets());
    BlockOrderScratch scratch;
    for (std::size_t b = 0; b < store.buckets(); ++b) {
      store.read(b, buckets[b]);
      sort_by_block(buckets[b], lattice, scratch);
    }
  }
};

struct Case {
  LocalSamples cloud;
  Lattice lattice;
  FeedSettings settings;
  std::int32_t bucket_height;
};

Case random_case(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto between = [&](double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); };
  const auto shape = static_cast<Shape>(random() % 4);
  CloudSettings cloud{
      shape, 20 + random() % 200, {0, 0, static_cast<int>(random() % 10000) - 5000}, between(100, 3000)};
  cloud.radius_low = between(20, 200);
  cloud.radius_high = between(20, 2000);
  cloud.quality = random() % 2 == 0;
  cloud.attributes = static_cast<int>(random() % 3);
  Case c{random_cloud(cloud, seed),
         {static_cast<std::int32_t>(between(10, 100)), 1 + static_cast<int>(random() % 6)},
         {},
         static_cast<std::int32_t>(between(20, 1500))};
  c.settings.blend = static_cast<float>(between(0.5, 4));
  c.settings.cell.value = between(0.5, 1.2);
  const bool follows = random() % 2 == 0;
  c.settings.cell.unit = random() % 4 == 0 ? Length::Unit::world
                         : follows         ? Length::Unit::influence_radius
                                           : Length::Unit::sample_radius;
  if (random() % 2 == 0) c.settings.max_radius = static_cast<float>(between(50, 1000));
  c.settings.batch_samples = 1 + random() % 60;
  c.settings.cache_bytes = random() % 2 == 0 ? 1 + random() % 3000 : 64u << 20;
  return c;
}

/// What a sample of influence radius r should become.
struct Expected {
  double radius, support;
  int level;
  bool left_out = false, clamped = false;
};
Expected expect_sample(const Case& c, double r) {
  Expected e{r, 0, 0};
  const double widest = 2.0 * c.lattice.cell_size(c.lattice.levels - 1) / c.settings.cell_ratio() /
                        (c.settings.cell_follows_support() ? c.settings.blend : 1.0);
  if (c.settings.max_radius > 0 && r > c.settings.max_radius) {
    e.radius = 0;
    e.left_out = true;
  } else if (r > widest) {
    e.radius = widest;
    e.clamped = true;
  }
  e.support = e.radius * c.settings.blend;
  const double cell = c.settings.cell_ratio() * (c.settings.cell_follows_support() ? e.support : e.radius);
  // The coarsest cells that are small enough; where none are, the finest.
  for (int l = 1; l < c.lattice.levels && !c.settings.fixed_cell() && c.lattice.cell_size(l) <= cell; ++l) e.level = l;
  return e;
}

void expect_bucket(const Case& c, const LocalSamples& stored, const std::vector<float>& radii, const ActiveBucket& b) {
  const std::size_t n = stored.size();
  RC_ASSERT(b.samples.size() == n);
  RC_ASSERT(b.support.size() == n && b.weight.size() == n && b.level.size() == n);
  RC_ASSERT(b.samples.x == stored.x && b.samples.y == stored.y && b.samples.z == stored.z);
  RC_ASSERT(b.samples.nx == stored.nx && b.samples.attributes == stored.attributes);
  float largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Expected e = expect_sample(c, radii[i]);
    RC_ASSERT(std::abs(b.support[i] - e.support) <= 1e-6 * e.support);
    // q is proportional to the density 1 / r^2 and the quality; what it is a multiple of is the finest cell's.
    const double q =
        e.radius > 0 ? std::pow(c.lattice.cell / e.radius, 2) * (stored.quality.empty() ? 1 : stored.quality[i]) : 0;
    RC_ASSERT(std::abs(b.weight[i] - q) <= 1e-6 * q);
    const double wanted = c.settings.cell_ratio() * (c.settings.cell_follows_support() ? e.support : e.radius);
    const double cell = c.lattice.cell_size(b.level[i]);
    // Rounding may decide only where a level fits exactly, as for clamped radii.
    RC_ASSERT(b.level[i] == e.level || std::abs(wanted - cell) < 1e-5 * cell ||
              std::abs(wanted - 2 * cell) < 1e-5 * cell);
    largest = std::max(largest, b.support[i]);
  }
  RC_ASSERT(b.max_support == largest);
}

TEST(SampleFeed, GivenRadiiBecomeSupportsLevelsAndWeights) {
  std::uint64_t left_out = 0;
  std::uint64_t clamped = 0;
  EXPECT_TRUE(rc::check("annotations", [&] {
    const Case c = random_case(*rc::gen::arbitrary<std::uint64_t>());
    Stored stored(c.cloud, c.lattice, c.bucket_height);
    SampleFeed feed(stored.store, c.lattice, c.settings, {}, true);
    FeedCounts expected;
    std::vector<std::size_t> order;  // non-empty buckets
    for (std::size_t b = 0; b < stored.buckets.size(); ++b) {
      if (stored.buckets[b].size() > 0) order.push_back(b);
      for (const float r : stored.buckets[b].radius) {
        const Expected e = expect_sample(c, r);
        ++expected.samples;
        expected.undersampled += e.left_out ? 1 : 0;
        expected.clamped += e.clamped ? 1 : 0;
        RC_ASSERT(e.support <= feed.support_limit() * 1.000001);
      }
    }
    std::size_t next = 0;
    // In several steps: after each, exactly the buckets that begin below the limit are known.
    for (std::int64_t z = stored.store.z_lower(order[0]) - 3; next < order.size(); z += c.bucket_height / 2 + 1) {
      feed.prepare(z, [&](const Batch& ready) {
        for (const auto& b : ready) {
          RC_ASSERT(next < order.size());
          expect_bucket(c, stored.buckets[order[next]], stored.buckets[order[next]].radius, *b);
          ++next;
        }
      });
      if (next % 2 == 0) feed.look_ahead(z + c.bucket_height / 2 + 1, z + c.bucket_height);
      for (std::size_t k = 0; k < order.size(); ++k) {
        RC_ASSERT((k < next) == (stored.store.z_lower(order[k]) < z));
      }
    }
    RC_ASSERT(feed.counts().samples == expected.samples);
    RC_ASSERT(feed.counts().undersampled == expected.undersampled);
    RC_ASSERT(feed.counts().clamped == expected.clamped);
    left_out += expected.undersampled;
    clamped += expected.clamped;
  }));
  EXPECT_GT(left_out, 100U);
  EXPECT_GT(clamped, 100U);
}

TEST(SampleFeed, EstimatedRadiiAreTheEstimatorsScaled) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    LocalSamples cloud = random_cloud({Shape::sphere, 1500, {0, 0, 0}, 1000}, seed);
    cloud.radius.clear();
    Case c{cloud, {20, 5}, {}, 61 + static_cast<std::int32_t>(seed) * 100};
    c.settings.radius_scale = 0.5F + 0.25F * static_cast<float>(seed);
    c.settings.max_radius = seed % 2 == 0 ? 0.0F : 120.0F;
    const RadiiSettings radii{60, 4};
    Stored stored(cloud, c.lattice, c.bucket_height);
    RadiusEstimator estimator(radii);
    for (const LocalSamples& b : stored.buckets) estimator.push(b);
    estimator.finish();
    std::vector<std::vector<float>> expected(stored.buckets.size());
    for (auto& r : expected) ASSERT_TRUE(estimator.pop(r));

    SampleFeed feed(stored.store, c.lattice, c.settings, radii, false);
    std::size_t bucket = 0;
    std::size_t samples = 0;
    for (std::int64_t z = -1200; z < 1400; z += 150) {
      feed.prepare(z, [&](const Batch& ready) {
        for (const auto& b : ready) {
          while (stored.buckets[bucket].size() == 0) ++bucket;
          std::vector<float> scaled = expected[bucket];
          for (float& r : scaled) r *= c.settings.radius_scale;
          expect_bucket(c, stored.buckets[bucket], scaled, *b);
          samples += b->samples.size();
          ++bucket;
        }
      });
      if (seed % 3 != 0) feed.look_ahead(z + (seed % 3 == 1 ? 150 : 700), z + 300);
    }
    EXPECT_EQ(samples, cloud.size());
    EXPECT_EQ(feed.counts().samples, cloud.size());
  }
}

/// The buckets of a store outside of a span lie in others.
SlabStore part_of(const Stored& stored, const BucketSpan& span, std::int32_t bucket_height,
                  const TemporaryFolder& folder) {
  StoreSettings settings;
  settings.directory = folder.path();
  settings.z_min = floor_div(stored.store.z_lower(0), bucket_height) * bucket_height;
  settings.bucket_height = bucket_height;
  settings.buckets = stored.buckets.size();
  SlabStoreWriter writer(stored.store.layout(), settings);
  for (std::size_t b = span.begin; b < span.end; ++b) {
    LocalSamples samples;
    stored.store.read(b, samples);
    writer.append(samples);
  }
  SlabStore part = writer.finish();
  declare_shares(part, bucket_shares(stored.store));
  return part;
}

TEST(SampleFeed, LooksAheadNoFartherThanTheBucketsThatAreRead) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    LocalSamples cloud = random_cloud({Shape::sphere, 3000, {0, 0, 0}, 1000}, seed);
    cloud.radius.clear();
    FeedSettings settings;
    settings.refine_sheets = seed % 2 == 0;
    const std::int32_t height = 30 + 10 * static_cast<std::int32_t>(seed);
    const Lattice lattice{20, 3};
    const RadiiSettings radii{30, 2};
    const Stored stored(cloud, lattice, height);
    const std::int64_t from = -500, to = 100;
    const BucketSpan span = buckets_read(stored.store, feed_halo(settings, lattice, radii, false), from, to);
    ASSERT_LT(span.end, stored.buckets.size()) << seed;
    ASSERT_GT(span.begin, 0U) << seed;
    const TemporaryFolder folder;
    SlabStore part = part_of(stored, span, height, folder);
    SampleFeed feed(part, lattice, settings, radii, false);
    feed.begin_at(from);
    std::uint64_t samples = 0;
    for (std::int64_t z = from; z <= to; z += 60) {
      const auto take = [&](const Batch& ready) {
        for (const auto& b : ready) samples += b->samples.size();
      };
      ASSERT_NO_THROW(feed.prepare(z, take)) << seed;
      ASSERT_NO_THROW(feed.look_ahead(std::min(z + 60, to), std::min(z + 120, to))) << seed;
    }
    EXPECT_GT(samples, 300U);
  }
}

/// All samples of the batches, in order, as (bucket, index), with supports.
void expect_batches(const Case& c, const Stored& stored, SampleFeed& feed, std::int64_t lo, std::int64_t hi,
                    float margin) {
  const auto batches = feed.batches(lo, hi, margin);
  std::vector<std::size_t> buckets;
  for (const auto& batch : batches) {
    RC_ASSERT(!batch.empty());
    std::uint64_t held = 0;
    for (const std::size_t b : batch) {
      RC_ASSERT((buckets.empty() || buckets.back() < b));  // in order, each once
      buckets.push_back(b);
      held += stored.store.count(b);
    }
    RC_ASSERT(batch.size() == 1 || held <= c.settings.batch_samples);
    const Batch loaded = feed.load(batch);
    RC_ASSERT(loaded.size() == batch.size());
    for (std::size_t k = 0; k < batch.size(); ++k) {
      expect_bucket(c, stored.buckets[batch[k]], stored.buckets[batch[k]].radius, *loaded[k]);
    }
  }
  // Nothing in reach is missing, and no bucket comes without a sample whose box could reach.
  for (std::size_t b = 0; b < stored.buckets.size(); ++b) {
    const LocalSamples& s = stored.buckets[b];
    bool reaches = false;
    double largest = 0;
    for (std::size_t i = 0; i < s.size(); ++i) {
      const double support = expect_sample(c, s.radius[i]).support;
      largest = std::max(largest, support);
      if (support <= 0) continue;
      reaches = reaches || (s.z[i] + support + margin >= static_cast<double>(lo) + 1e-2 &&
                            s.z[i] - support - margin < static_cast<double>(hi) - 1e-2);
    }
    const bool there = std::binary_search(buckets.begin(), buckets.end(), b);
    RC_ASSERT(!reaches || there);
    if (there) {
      RC_ASSERT(s.size() > 0);
      RC_ASSERT(stored.store.z_upper(b) + largest + margin >= static_cast<double>(lo) - 2);
      RC_ASSERT(stored.store.z_lower(b) - largest - margin < static_cast<double>(hi) + 2);
    }
  }
}

TEST(SampleFeed, BatchesHoldEverySampleInReachOnceWhateverTheCache) {
  EXPECT_TRUE(rc::check("batches", [] {
    const std::uint64_t seed = *rc::gen::arbitrary<std::uint64_t>();
    const Case c = random_case(seed);
    Stored stored(c.cloud, c.lattice, c.bucket_height);
    SampleFeed feed(stored.store, c.lattice, c.settings, {}, true);
    feed.prepare(kEverything, [](const Batch&) {});
    std::mt19937_64 random(seed);
    for (int round = 0; round < 8; ++round) {
      const std::int64_t lo = static_cast<std::int64_t>(random() % 20000) - 10000;
      const std::int64_t hi = lo + 1 + static_cast<std::int64_t>(random() % 2000);
      expect_batches(c, stored, feed, lo, hi, random() % 2 == 0 ? 0.0F : static_cast<float>(random() % 500));
    }
    expect_batches(c, stored, feed, -30000, 30000, 0);
  }));
}

TEST(SampleFeed, ReleaseForgetsOnlyWhatEndsBelow) {
  EXPECT_TRUE(rc::check("release", [] {
    const std::uint64_t seed = *rc::gen::arbitrary<std::uint64_t>();
    const Case c = random_case(seed);
    Stored stored(c.cloud, c.lattice, c.bucket_height);
    SampleFeed feed(stored.store, c.lattice, c.settings, {}, true);
    SampleFeed whole(stored.store, c.lattice, c.settings, {}, true);
    whole.prepare(kEverything, [](const Batch&) {});
    const auto [low, high] = std::minmax_element(c.cloud.z.begin(), c.cloud.z.end());
    std::mt19937_64 random(seed);
    const auto limit = static_cast<std::int64_t>(feed.support_limit());
    // A sweep as the job makes it: what lies below the reach of the range asked for is released.
    for (std::int64_t z = *low; z <= *high; z += 1 + static_cast<std::int64_t>(random() % 900)) {
      feed.prepare(z + 500 + limit + 1, [](const Batch&) {});
      feed.release(z - limit - 1);
      std::uint64_t below = 0;
      for (std::size_t b = 0; b < stored.buckets.size(); ++b) {
        if (stored.store.count(b) > 0 && stored.store.z_upper(b) < z - limit - 1) below += stored.store.count(b);
      }
      RC_ASSERT(feed.released() == below);
      RC_ASSERT(feed.batches(z, z + 500, 0) == whole.batches(z, z + 500, 0));
      expect_batches(c, stored, feed, z, z + 500, 0);
    }
    feed.prepare(kEverything, [](const Batch&) {});
    feed.release(kEverything);
    RC_ASSERT(feed.released() == c.cloud.size());
    RC_ASSERT(feed.batches(-100000, 100000, 0).empty());
  }));
}

TEST(SampleFeed, CacheHoldsWhatItsBudgetAllows) {
  const LocalSamples cloud = random_cloud({Shape::sphere, 2000, {0, 0, 0}, 1000}, 3);
  Stored stored(cloud, {64, 4}, 200);
  const std::uint64_t n = stored.buckets.size();
  const auto reads_of = [&](std::size_t cache_bytes) {
    FeedSettings settings;
    settings.cache_bytes = cache_bytes;
    SampleFeed feed(stored.store, {64, 4}, settings, {}, true);
    feed.prepare(kEverything, [](const Batch&) {});
    const std::uint64_t before = feed.counts().bucket_reads;
    for (int round = 0; round < 3; ++round) {
      for (const auto& batch : feed.batches(-5000, 5000, 0)) (void)feed.load(batch);
    }
    return feed.counts().bucket_reads - before;
  };
  EXPECT_EQ(reads_of(64u << 20), 0U);
  EXPECT_EQ(reads_of(1), 3 * n);  // only the last one stays, and it is never the next one asked for
}

TEST(SampleFeed, BucketsSetAsideAreReadAgainWhenTheyAreAskedFor) {
  const LocalSamples cloud = random_cloud({Shape::sphere, 2000, {0, 0, 0}, 1000}, 3);
  Stored stored(cloud, {64, 4}, 200);
  SampleFeed feed(stored.store, {64, 4}, {}, {}, true);
  feed.prepare(kEverything, [](const Batch&) {});
  const std::vector<std::size_t> one{feed.batches(-5000, 5000, 0).at(0).at(1)};
  const Batch before = feed.load(one);
  const std::uint64_t reads = feed.counts().bucket_reads;
  feed.set_aside(one[0]);
  EXPECT_EQ(feed.counts().bucket_reads, reads);
  const Batch again = feed.load(one);
  EXPECT_EQ(feed.counts().bucket_reads, reads + 1);
  EXPECT_EQ(again[0]->samples.x, before[0]->samples.x);
  EXPECT_EQ(again[0]->support, before[0]->support);
}

TEST(SampleFeed, LoadedSamplesOutliveTheCache) {
  const LocalSamples cloud = random_cloud({Shape::sphere, 500, {0, 0, 0}, 1000}, 4);
  Stored stored(cloud, {64, 4}, 150);
  FeedSettings settings;
  settings.cache_bytes = 1;
  SampleFeed feed(stored.store, {64, 4}, settings, {}, true);
  feed.prepare(kEverything, [](const Batch&) {});
  const auto batches = feed.batches(-5000, 5000, 0);
  ASSERT_EQ(batches.size(), 1U);
  const Batch batch = feed.load(batches[0]);
  feed.release(kEverything);
  std::size_t n = 0;
  for (const auto& b : batch) {
    for (std::size_t i = 0; i < b->samples.size(); ++i) n += b->support[i] > 0 ? 1 : 0;
  }
  EXPECT_EQ(n, cloud.size());
}

}  // namespace
}  // namespace lamina::test
