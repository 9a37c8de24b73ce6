// Stores of parts of a cloud, put together: the store of the whole.
#include "store/block_codec.h"
#include "store/slab_store.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <random>

#include "base/temporary_folder.h"
#include "lamina/error.h"

namespace lamina {
namespace {

LocalSamples random_samples(std::size_t n, std::mt19937& random) {
  LocalSamples s;
  std::uniform_int_distribution<std::int32_t> position(-1000, 999);
  s.attributes.resize(1);
  for (std::size_t i = 0; i < n; ++i) {
    s.x.push_back(position(random));
    s.y.push_back(position(random));
    s.z.push_back(position(random));
    s.nx.push_back(0);
    s.ny.push_back(0);
    s.nz.push_back(1);
    s.attributes[0].push_back(static_cast<float>(random() % 256));
  }
  return s;
}

const StoreLayout kLayout{false, false, {{"red", ScalarType::uint8}}};

SlabStore store_of(const std::vector<const LocalSamples*>& parts, const test::TemporaryFolder& folder) {
  StoreSettings settings;
  settings.directory = folder.path();
  settings.z_min = -1000;
  settings.bucket_height = 100;
  settings.buckets = 20;
  settings.buffer_bytes = 1 << 16;
  SlabStoreWriter writer(kLayout, settings);
  for (const LocalSamples* part : parts) writer.append(*part);
  return writer.finish();
}

bool same_rows(const LocalSamples& a, const LocalSamples& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z && a.nx == b.nx && a.attributes == b.attributes;
}

void copy_bucket(const SlabStore& from, std::size_t bucket, std::size_t source, StoreGatherer& to) {
  for (const BlockEntry& block : blocks_of(from, bucket)) {
    std::vector<std::byte> bytes(block.bytes);
    read_block(from, bucket, block, bytes);
    to.add(bucket, source, {block.count, bytes});
  }
}

TEST(StoreBlocks, GatheredPartsAreTheWhole) {
  rc::check("buckets of the gathered store are those of one writer", [] {
    const test::TemporaryFolder folder;
    std::mt19937 random(*rc::gen::arbitrary<unsigned>());
    const LocalSamples a = random_samples(random() % 3000, random), b = random_samples(random() % 3000, random);
    const SlabStore whole = store_of({&a, &b}, folder), first = store_of({&a}, folder), second = store_of({&b}, folder);
    const std::vector<BucketShare> shares = bucket_shares(whole);
    StoreGatherer gatherer(kLayout, folder.path(), shares, 2);
    const std::size_t begin = random() % 10, end = 10 + random() % 11;
    for (std::size_t bucket = begin; bucket < end; ++bucket) {
      // Sources may come in any order.
      copy_bucket(second, bucket, 1, gatherer);
      copy_bucket(first, bucket, 0, gatherer);
    }
    const SlabStore gathered = gatherer.finish();
    RC_ASSERT(gathered.total() == whole.total());
    for (std::size_t bucket = 0; bucket < whole.buckets(); ++bucket) {
      RC_ASSERT(gathered.count(bucket) == whole.count(bucket));
      RC_ASSERT(gathered.z_lower(bucket) == whole.z_lower(bucket));
      if (bucket < begin || bucket >= end) continue;
      LocalSamples expected, found;
      whole.read(bucket, expected);
      gathered.read(bucket, found);
      RC_ASSERT(same_rows(found, expected));
    }
  });
}

TEST(StoreBlocks, BucketsThatLieElsewhereAreNotRead) {
  const test::TemporaryFolder folder;
  std::mt19937 random(3);
  const LocalSamples a = random_samples(1000, random), b = random_samples(1000, random);
  SlabStore part = store_of({&a}, folder);
  declare_shares(part, bucket_shares(store_of({&a, &b}, folder)));
  EXPECT_EQ(part.total(), 2000u);
  LocalSamples out;
  EXPECT_THROW(part.read(5, out), Error);
}

TEST(StoreBlocks, UnpackedBlocksAreTheBucket) {
  const test::TemporaryFolder folder;
  std::mt19937 random(4);
  const LocalSamples a = random_samples(5000, random);
  const SlabStore store = store_of({&a}, folder);
  std::vector<std::vector<std::byte>> bytes;
  std::vector<CodedBlock> blocks;
  for (const BlockEntry& block : blocks_of(store, 7)) {
    read_block(store, 7, block, bytes.emplace_back(block.bytes));
    blocks.push_back({block.count, bytes.back()});
  }
  ASSERT_GT(blocks.size(), 0u);
  for (std::size_t i = 0; i < blocks.size(); ++i) blocks[i].bytes = bytes[i];
  LocalSamples expected, found;
  store.read(7, expected);
  decode_blocks(kLayout, blocks, found);
  EXPECT_TRUE(same_rows(found, expected));
  bytes[0].pop_back();
  blocks[0].bytes = bytes[0];
  EXPECT_THROW(decode_blocks(kLayout, blocks, found), Error);
}

}  // namespace
}  // namespace lamina
