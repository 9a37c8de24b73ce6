#include "samples/radii_ahead.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <fstream>
#include <random>

#include "lamina/error.h"
#include "store/block_codec.h"
#include "support/random_cloud.h"
#include "support/streamed_cloud.h"

namespace lamina::test {
namespace {

const Lattice kCounted{20, 4};
const RadiiSettings kCounting{60, 4};

struct MeasuredCloud {
  std::vector<BlockOrder> orders;
  std::vector<std::vector<float>> radii;
};

/// What the estimator says of buckets from `first` on that are sorted as a whole.
MeasuredCloud measured_from(const SlabStore& store, std::size_t first) {
  MeasuredCloud out;
  RadiusEstimator estimator(kCounting);
  BlockOrderScratch scratch;
  for (std::size_t b = first; b < store.buckets(); ++b) {
    LocalSamples samples;
    store.read(b, samples);
    out.orders.push_back(order_by_block(samples, kCounted, scratch));
    put_in_order(samples, out.orders.back(), scratch);
    estimator.push(samples);
  }
  estimator.finish();
  for (std::vector<float> radii; estimator.pop(radii);) out.radii.push_back(radii);
  return out;
}

TEST(RadiiAhead, AreThoseOfTheEstimatorHoweverFarAhead) {
  EXPECT_TRUE(rc::check("ahead", [] {
    std::mt19937_64 random(*rc::gen::arbitrary<std::uint64_t>());
    LocalSamples cloud = random_cloud({Shape::sphere, 1500, {0, 0, 0}, 1000}, random());
    cloud.radius.clear();
    const SlabStore store = make_store(cloud, 20 + static_cast<std::int32_t>(random() % 300));
    const std::size_t first = random() % 3 == 0 ? random() % store.buckets() : 0;
    const MeasuredCloud expected = measured_from(store, first);
    RadiiAhead ahead(store, kCounted, kCounting);
    ahead.begin_at(first);
    std::size_t bucket = 0;
    for (std::int64_t z = -1100; z < 1600; z += 1 + static_cast<std::int64_t>(random() % 400)) {
      ahead.measure_below(z);
      if (random() % 2 == 0) continue;  // the background has two things to do
      for (const RadiiAhead::Measured& measured : ahead.take()) {
        RC_ASSERT(bucket < expected.radii.size());
        RC_ASSERT(measured.radii == expected.radii[bucket]);
        RC_ASSERT(measured.order == expected.orders[bucket]);
        ++bucket;
      }
      // All that begin below are known.
      for (std::size_t b = first + bucket; b < store.buckets(); ++b)
        RC_ASSERT(store.count(b) == 0 || store.z_lower(b) >= z);
    }
  }));
}

TEST(RadiiAhead, TellsOfADamagedBucketWhenItIsAskedFor) {
  LocalSamples cloud = random_cloud({Shape::sphere, 3000, {0, 0, 0}, 1000}, 5);
  cloud.radius.clear();
  const TemporaryFolder folder;
  StoreSettings settings;
  settings.directory = folder.path();
  settings.z_min = -1100;
  settings.bucket_height = 100;
  settings.buckets = 22;
  settings.keep = true;
  SlabStoreWriter writer(layout_of(cloud), settings);
  writer.append(cloud);
  const SlabStore store = writer.finish();
  // The upper half of the buckets is in the second file.
  std::ofstream(folder.path() + "/" + store_file_name(1), std::ios::trunc) << "nothing";
  RadiiAhead ahead(store, kCounted, {20, 2, 16, 1.5F});  // radii do not look far
  ahead.measure_below(-600);
  const std::size_t measured = ahead.take().size();
  EXPECT_GE(measured, 5U);
  EXPECT_LT(measured, 11U);
  ahead.measure_below(500);
  EXPECT_THROW((void)ahead.take(), Error);
}

}  // namespace
}  // namespace lamina::test
