// What a finished store consists of, for the writer that makes it and the store that reads it; and its blocks as they
// rest on disk, for moving them between stores without unpacking them.
#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/background_writer.h"
#include "base/spill_file.h"
#include "store/block_codec.h"
#include "store/slab_store.h"

namespace lamina {

struct BucketIndex {
  std::vector<BlockEntry> blocks;        ///< in the order of append()
  std::vector<std::uint32_t> checksums;  ///< of the blocks, where the store is kept
  std::uint64_t count = 0;
  std::vector<bool> keep{};  ///< of the samples in the blocks, which stay; empty: all
  std::int32_t z_lower = std::numeric_limits<std::int32_t>::max();
  std::int32_t z_upper = std::numeric_limits<std::int32_t>::min();
};

/// CRC-32 of a block as it lies in the file.
std::uint32_t block_checksum(std::span<const std::byte> block);
/// Name of a kept store's file.
std::string store_file_name(std::size_t file);

struct SlabStore::Impl {
  SampleColumns columns;
  StoreLayout layout;
  std::vector<SpillFile> files;  ///< each holds a run of buckets, so that the disk they take can be given back
  std::vector<BucketIndex> buckets;
  std::uint64_t total = 0;
  std::size_t released = 0;  ///< files before this one are gone
  std::string directory;     ///< where the store is kept; empty: it is not

  [[nodiscard]] SpillFile& file_of(std::size_t bucket) { return files[bucket * files.size() / buckets.size()]; }
};

/// The insides of a store, for those that move its blocks.
struct StoreAccess {
  using Impl = SlabStore::Impl;
  static Impl& of(SlabStore& store) { return *store.impl_; }
  static const Impl& of(const SlabStore& store) { return *store.impl_; }
  static SlabStore make(std::unique_ptr<Impl> impl) { return SlabStore(std::move(impl)); }
};

/// What is known of a bucket without its samples; the greatest and the least int32 where it has none.
struct BucketShare {
  std::uint64_t count = 0;
  std::int32_t z_lower = std::numeric_limits<std::int32_t>::max();
  std::int32_t z_upper = std::numeric_limits<std::int32_t>::min();
};

std::vector<BucketShare> bucket_shares(const SlabStore& store);

/// Says that a store is one of several and its buckets hold, taken together, what `all` says: from here on it gives
/// those counts, and read() works where the others have nothing. Its blocks stay what they are.
void declare_shares(SlabStore& store, const std::vector<BucketShare>& all);

/// A store's own blocks of a bucket, in order.
std::span<const BlockEntry> blocks_of(const SlabStore& store, std::size_t bucket);

/// Fills `out`, as long as the block. Throws as SlabStore::read() does.
void read_block(const SlabStore& store, std::size_t bucket, const BlockEntry& block, std::span<std::byte> out);

/// A block on its way.
struct CodedBlock {
  std::uint32_t count = 0;  ///< samples
  std::span<const std::byte> bytes;
};

/// Unpacks blocks, one after the other, as SlabStore::read() does. Throws Error(internal) for what is none.
void decode_blocks(const StoreLayout& layout, std::span<const CodedBlock> blocks, LocalSamples& out);

/// Puts a store together from blocks of several: of each bucket first those of source 0, then those of source 1, ...
class StoreGatherer {
 public:
  /// `all`: what the buckets hold in all sources together. Throws as SlabStoreWriter.
  StoreGatherer(const StoreLayout& layout, const std::string& directory, const std::vector<BucketShare>& all,
                std::size_t sources);
  /// Blocks of one bucket and one source come in their order; else in any. Throws Error(budget) when the disk is full,
  /// Error(internal) for a bucket or source that is none.
  void add(std::size_t bucket, std::size_t source, const CodedBlock& block);
  /// The store, which holds what was added; buckets may be left out. The gatherer is spent.
  SlabStore finish();

 private:
  std::unique_ptr<StoreAccess::Impl> store_;
  std::vector<std::vector<std::vector<BlockEntry>>> blocks_;  ///< by bucket, then by source; empty until there are some
  std::size_t sources_;
  BackgroundWriter disk_;
};

}  // namespace lamina
