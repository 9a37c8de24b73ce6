#include "store/block_codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "lamina/error.h"

namespace lamina {
namespace {

constexpr std::size_t kBuffersMoved = 16;
/// A store of several sources holds a part of the buckets: it has more files, so that their disk is given back as soon.
constexpr std::size_t kFilesPerSource = 16, kMostFiles = 128, kBucketsPerPart = 8;

[[noreturn]] void defect(const std::string& what) {
  throw Error(ExitCode::internal, "slab store: " + what);
}

}  // namespace

std::vector<BucketShare> bucket_shares(const SlabStore& store) {
  std::vector<BucketShare> shares;
  for (const BucketIndex& bucket : StoreAccess::of(store).buckets)
    shares.push_back({bucket.count, bucket.z_lower, bucket.z_upper});
  return shares;
}

void declare_shares(SlabStore& store, const std::vector<BucketShare>& all) {
  StoreAccess::Impl& impl = StoreAccess::of(store);
  if (all.size() != impl.buckets.size()) defect("stores with different numbers of buckets are none of one cloud");
  impl.total = 0;
  for (std::size_t b = 0; b < all.size(); ++b) {
    BucketIndex& bucket = impl.buckets[b];
    bucket.count = all[b].count;
    bucket.z_lower = all[b].z_lower;
    bucket.z_upper = all[b].z_upper;
    impl.total += all[b].count;
  }
}

std::span<const BlockEntry> blocks_of(const SlabStore& store, std::size_t bucket) {
  return StoreAccess::of(store).buckets[bucket].blocks;
}

void read_block(const SlabStore& store, std::size_t bucket, const BlockEntry& block, std::span<std::byte> out) {
  const StoreAccess::Impl& impl = StoreAccess::of(store);
  impl.files[bucket * impl.files.size() / impl.buckets.size()].read(block.offset, out);
}

void decode_blocks(const StoreLayout& layout, std::span<const CodedBlock> blocks, LocalSamples& out) {
  const SampleColumns columns(layout);
  std::size_t count = 0;
  for (const CodedBlock& block : blocks) count += block.count;
  columns.resize(out, count);
  std::size_t first = 0;
  for (const CodedBlock& block : blocks) {
    if (!decode_block(columns, block.bytes, block.count, out, first)) defect("a block arrived damaged");
    first += block.count;
  }
}

StoreGatherer::StoreGatherer(const StoreLayout& layout, const std::string& directory,
                             const std::vector<BucketShare>& all, std::size_t sources)
    : store_(new StoreAccess::Impl{
          SampleColumns(layout), layout, {}, std::vector<BucketIndex>(all.size()), 0, 0, std::string()}),
      blocks_(all.size()),
      sources_(sources),
      disk_(SpillFile::kBufferBytes, kBuffersMoved) {
  const std::size_t files =
      std::clamp<std::size_t>(all.size() / kBucketsPerPart, 1, std::min(kMostFiles, kFilesPerSource * sources));
  while (store_->files.size() < files) store_->files.emplace_back(directory);
  for (std::size_t b = 0; b < all.size(); ++b) {
    store_->buckets[b].count = all[b].count;
    store_->buckets[b].z_lower = all[b].z_lower;
    store_->buckets[b].z_upper = all[b].z_upper;
    store_->total += all[b].count;
  }
}

void StoreGatherer::add(std::size_t bucket, std::size_t source, const CodedBlock& block) {
  if (bucket >= blocks_.size() || source >= sources_ || block.count > kBlockRows) defect("a block arrived astray");
  if (blocks_[bucket].empty()) blocks_[bucket].resize(sources_);
  const std::uint64_t offset = store_->file_of(bucket).append(block.bytes, disk_);
  blocks_[bucket][source].push_back({offset, static_cast<std::uint32_t>(block.bytes.size()), block.count});
}

SlabStore StoreGatherer::finish() {
  for (SpillFile& file : store_->files) file.flush(disk_);
  store_->files.front().check(disk_.drain());
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    for (const std::vector<BlockEntry>& of_source : blocks_[b])
      store_->buckets[b].blocks.insert(store_->buckets[b].blocks.end(), of_source.begin(), of_source.end());
  }
  return StoreAccess::make(std::move(store_));
}

}  // namespace lamina
