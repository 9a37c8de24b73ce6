// What a finished store consists of; shared by the writer that makes it and the store that reads it.
#pragma once
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/spill_file.h"
#include "store/block_codec.h"
#include "store/columns.h"

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

}  // namespace lamina
